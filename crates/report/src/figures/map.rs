//! A map over two varied keys.

use super::colors::{INK, SOFT, Shade, color};
use super::drawing::{Anchor, Drawing};

/// A map over two varied keys.
#[derive(Debug, Clone, Default)]
pub struct Map {
    /// The heading.
    pub title: String,
    /// The quantity varied from left to right.
    pub x_label: String,
    /// The quantity varied from bottom to top.
    pub y_label: String,
    /// Values from left to right.
    pub columns: Vec<String>,
    /// Values from bottom to top.
    pub rows: Vec<String>,
    /// The lowest row from left to right, then the one above it.
    pub cells: Vec<MapCell>,
    /// The meaning of the shades and the numbers, one entry a line.
    pub legend: Vec<(Option<Shade>, String)>,
}

/// A cell of a map.
#[derive(Debug, Clone)]
pub struct MapCell {
    /// Its colour.
    pub shade: Shade,
    /// Its text.
    pub text: String,
}

/// Position of the cells of a map.
struct Grid {
    columns: usize,
    rows: usize,
    /// Width and height of a cell.
    cell: [f32; 2],
    left: f32,
    top: f32,
    right: f32,
    bottom: f32,
}

impl Map {
    /// The map as a drawing.
    pub fn drawing(&self) -> Drawing {
        let grid = self.grid();
        // names that are wider than a column are drawn at every second or third column, or vertically where that is still
        // too wide
        let every = ((6.4 * letters(&self.columns)) / grid.cell[0]).ceil().max(1.0) as usize;
        let turned = every > 6;
        let below = if turned {
            12.0 + 6.2 * letters(&self.columns)
        } else {
            16.0
        };
        let longest = self
            .legend
            .iter()
            .map(|(_, text)| text.chars().count())
            .max()
            .unwrap_or(0) as f32;
        let mut drawing = Drawing {
            width: (grid.right + 24.0)
                .max(90.0 + 6.0 * longest)
                .max(30.0 + 7.6 * self.title.chars().count() as f32),
            height: grid.bottom + below + 26.0 + 16.0 * self.legend.len() as f32,
            items: Vec::new(),
        };
        drawing.text([14.0, 22.0], &self.title, 13.0, INK, Anchor::Start);
        self.draw_cells(&mut drawing, &grid);
        grid.draw_lines(&mut drawing);
        for (column, name) in self.columns.iter().enumerate() {
            let x = grid.left + (column as f32 + 0.5) * grid.cell[0];
            if turned {
                let middle = grid.bottom + 8.0 + 3.1 * letters(&self.columns);
                drawing.upright([x + 3.0, middle], name, 9.0, SOFT);
            } else if column % every == 0 {
                drawing.text([x, grid.bottom + 14.0], name, 9.5, SOFT, Anchor::Middle);
            }
        }
        for (row, name) in self.rows.iter().enumerate() {
            let y = grid.bottom - (row as f32 + 0.5) * grid.cell[1] + 3.5;
            drawing.text([grid.left - 6.0, y], name, 9.5, SOFT, Anchor::End);
        }
        drawing.text(
            [(grid.left + grid.right) / 2.0, grid.bottom + below + 16.0],
            &self.x_label,
            10.0,
            SOFT,
            Anchor::Middle,
        );
        drawing.text([14.0, 44.0], &self.y_label, 10.0, SOFT, Anchor::Start);
        self.draw_legend(&mut drawing, grid.left, grid.bottom + below + 34.0);
        drawing
    }

    fn grid(&self) -> Grid {
        let (columns, rows) = (self.columns.len().max(1), self.rows.len().max(1));
        let cell = [
            (720.0 / columns as f32).clamp(14.0, 64.0),
            (420.0 / rows as f32).clamp(12.0, 34.0),
        ];
        let (left, top) = (30.0 + 6.2 * letters(&self.rows), 56.0);
        Grid {
            columns,
            rows,
            cell,
            left,
            top,
            right: left + columns as f32 * cell[0],
            bottom: top + rows as f32 * cell[1],
        }
    }

    fn draw_cells(&self, drawing: &mut Drawing, grid: &Grid) {
        let cell = grid.cell;
        let widest = self
            .cells
            .iter()
            .map(|cell| cell.text.chars().count())
            .max()
            .unwrap_or(0) as f32;
        for (number, one) in self.cells.iter().enumerate() {
            let (column, row) = (number % grid.columns, number / grid.columns);
            let corner = [
                grid.left + column as f32 * cell[0],
                grid.bottom - (row + 1) as f32 * cell[1],
            ];
            drawing.area(
                [corner[0], corner[1], corner[0] + cell[0], corner[1] + cell[1]],
                color(one.shade),
            );
            let size = (1.55 * cell[0] / widest.max(1.0)).min(0.62 * cell[1]).min(9.5);
            if size >= 4.5 && !one.text.is_empty() {
                let at = [corner[0] + cell[0] / 2.0, corner[1] + cell[1] / 2.0 + 0.35 * size];
                drawing.text(at, &one.text, size, INK, Anchor::Middle);
            }
        }
    }

    /// Draws one entry per line, the first one at `top`.
    fn draw_legend(&self, drawing: &mut Drawing, left: f32, top: f32) {
        for (line, (shade, text)) in self.legend.iter().enumerate() {
            let y = top + 16.0 * line as f32;
            if let Some(shade) = shade {
                drawing.area([left, y - 9.0, left + 18.0, y + 1.0], color(*shade));
                let box_ = [
                    [left, y - 9.0],
                    [left + 18.0, y - 9.0],
                    [left + 18.0, y + 1.0],
                    [left, y + 1.0],
                    [left, y - 9.0],
                ];
                drawing.line(box_.to_vec(), SOFT, 0.5, None, None);
            }
            drawing.text([left + 24.0, y], text, 9.5, SOFT, Anchor::Start);
        }
    }
}

impl Grid {
    /// White lines between the cells, and the frame.
    fn draw_lines(&self, drawing: &mut Drawing) {
        let Grid {
            left,
            top,
            right,
            bottom,
            cell,
            ..
        } = *self;
        for column in 0..=self.columns {
            let x = left + column as f32 * cell[0];
            drawing.line(vec![[x, top], [x, bottom]], [255, 255, 255], 0.8, None, None);
        }
        for row in 0..=self.rows {
            let y = top + row as f32 * cell[1];
            drawing.line(vec![[left, y], [right, y]], [255, 255, 255], 0.8, None, None);
        }
        let frame = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        drawing.line(frame.to_vec(), SOFT, 0.7, None, None);
    }
}

/// Length of the longest name, letters.
fn letters(names: &[String]) -> f32 {
    names.iter().map(|name| name.chars().count()).max().unwrap_or(0) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::drawing::Item;
    use crate::figures::{png, svg};

    #[test]
    fn map_has_its_lowest_row_at_the_bottom() {
        let cell = |shade, text: &str| MapCell {
            shade,
            text: text.into(),
        };
        let map = Map {
            title: "where it works".into(),
            columns: vec!["0 ms".into(), "10 ms".into()],
            rows: vec!["5 ms".into(), "50 ms".into()],
            cells: vec![
                cell(Shade::Good(0.0), "low"),
                cell(Shade::Bad, ""),
                cell(Shade::Broken, ""),
                cell(Shade::Unknown, "high"),
            ],
            ..Map::default()
        };
        let drawing = map.drawing();
        let height = |wanted: &str| {
            let text = drawing.items.iter().find_map(|item| match item {
                Item::Text { at, text, .. } if text == wanted => Some(at[1]),
                _ => None,
            });
            text.unwrap_or_else(|| panic!("{wanted} is not drawn"))
        };
        assert!(height("low") > height("high"));
        assert!((height("low") - height("5 ms")).abs() < 5.0 && (height("high") - height("50 ms")).abs() < 5.0);
        let text = svg(&drawing);
        assert!(text.contains("#f4c9b0") && text.contains("where it works"), "{text}");
        assert!(png(&drawing, 1.0).is_some());
    }
}
