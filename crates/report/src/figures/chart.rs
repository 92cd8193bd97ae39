//! Charts of campaigns: curves over a varied number, and a map over two varied keys.

use super::axis::{decades, ticks};
use super::layout::{COLORS, GRID, INK, LIMIT, SOFT, extent};
use super::{Anchor, Drawing, Item, Rgb};

/// Where everything is well.
const GOOD: Rgb = [223, 240, 224];
/// Where something did not run at all.
const BROKEN: Rgb = [226, 226, 230];
/// A cell of a map that is not well.
const BAD: Rgb = [244, 201, 176];

/// Curves over a varied number, with limits, and bands for what became of each point.
#[derive(Debug, Clone, Default)]
pub struct Chart {
    /// The heading.
    pub title: String,
    /// What is varied, with its unit.
    pub x_label: String,
    /// What the curves show, with its unit.
    pub y_label: String,
    /// Names of the positions 0, 1, 2, … of the horizontal axis where they are no numbers.
    pub x_names: Vec<String>,
    /// Whether the vertical axis is logarithmic. What is not above zero then stands at its lower end.
    pub logarithmic: bool,
    /// The curves.
    pub curves: Vec<Curve>,
    /// Horizontal lines.
    pub limits: Vec<Limit>,
    /// Stretches of the horizontal axis.
    pub bands: Vec<Band>,
}

/// A curve with a mark at each of its points. A NaN is a gap.
#[derive(Debug, Clone)]
pub struct Curve {
    /// What it shows.
    pub name: String,
    /// Its points.
    pub points: Vec<[f64; 2]>,
}

/// A horizontal line that curves should stay below.
#[derive(Debug, Clone)]
pub struct Limit {
    /// Where.
    pub value: f64,
    /// What it is.
    pub name: String,
}

/// A stretch of the horizontal axis.
#[derive(Debug, Clone, Copy)]
pub struct Band {
    /// From here.
    pub from: f64,
    /// To here.
    pub to: f64,
    /// What became of it.
    pub shade: Shade,
}

/// What became of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shade {
    /// All is well; how near to the worst of those that are, from 0 to 1.
    Good(f32),
    /// A criterion is not met.
    Bad,
    /// It did not run.
    Broken,
    /// Not yet known.
    Unknown,
}

/// A map over two varied keys.
#[derive(Debug, Clone, Default)]
pub struct Map {
    /// The heading.
    pub title: String,
    /// What is varied from left to right.
    pub x_label: String,
    /// What is varied from bottom to top.
    pub y_label: String,
    /// Values from left to right.
    pub columns: Vec<String>,
    /// Values from bottom to top.
    pub rows: Vec<String>,
    /// The lowest row from left to right, then the one above it.
    pub cells: Vec<MapCell>,
    /// What the shades and the numbers mean, one entry a line.
    pub legend: Vec<(Option<Shade>, String)>,
}

/// A cell of a map.
#[derive(Debug, Clone)]
pub struct MapCell {
    /// Its colour.
    pub shade: Shade,
    /// What stands in it.
    pub text: String,
}

fn color(shade: Shade) -> Rgb {
    match shade {
        Shade::Good(part) => {
            // from a pale green to a deep one
            let (pale, deep) = ([226.0, 243.0, 226.0], [86.0, 168.0, 112.0]);
            let part = if part.is_finite() { part.clamp(0.0, 1.0) } else { 0.0 };
            std::array::from_fn(|k| (pale[k] + (deep[k] - pale[k]) * part).round() as u8)
        }
        Shade::Bad => BAD,
        Shade::Broken => BROKEN,
        Shade::Unknown => [255, 255, 255],
    }
}

impl Chart {
    /// The chart as a drawing.
    pub fn drawing(&self) -> Drawing {
        let (width, height) = (640.0, 360.0);
        let (left, right, top) = (74.0, width - 20.0, 46.0 + 14.0 * self.curves.len().div_ceil(2) as f32);
        let bottom = height - 46.0;
        let mut drawing = Drawing {
            width,
            height,
            items: Vec::new(),
        };
        drawing.text([14.0, 22.0], &self.title, 13.0, INK, Anchor::Start);
        let points = || self.curves.iter().flat_map(|curve| &curve.points);
        let bands = self.bands.iter().flat_map(|band| [band.from, band.to]);
        let (x0, x1) = extent(points().map(|point| point[0]).chain(bands));
        let x1 = if x1 > x0 { x1 } else { x0 + 1.0 };
        let limits = self.limits.iter().map(|limit| limit.value);
        let (y0, y1) = if self.logarithmic {
            let (lo, hi) = extent(
                points()
                    .map(|point| point[1])
                    .chain(limits)
                    .filter(|y| *y > 0.0)
                    .map(f64::log10),
            );
            (
                lo.floor(),
                if hi.ceil() > lo.floor() {
                    hi.ceil()
                } else {
                    lo.floor() + 1.0
                },
            )
        } else {
            let (lo, hi) = extent(points().map(|point| point[1]).chain(limits).chain([0.0]));
            (lo, if hi > lo { hi + 0.06 * (hi - lo) } else { lo + 1.0 })
        };
        let to_x = |x: f64| left + ((x - x0) / (x1 - x0)) as f32 * (right - left);
        let to_y = |y: f64| {
            let y = if self.logarithmic { y.max(1e-300).log10() } else { y };
            bottom - ((y.max(y0) - y0) / (y1 - y0)) as f32 * (bottom - top)
        };
        for band in &self.bands {
            let fill = match band.shade {
                Shade::Good(_) => GOOD,
                Shade::Broken => BROKEN,
                Shade::Bad | Shade::Unknown => continue,
            };
            drawing.area([to_x(band.from), top, to_x(band.to), bottom], fill);
        }
        if self.x_names.is_empty() {
            for (x, label) in ticks(x0, x1, 10) {
                drawing.line(vec![[to_x(x), top], [to_x(x), bottom]], GRID, 0.7, None, None);
                drawing.text([to_x(x), bottom + 15.0], &label, 9.5, SOFT, Anchor::Middle);
            }
        } else {
            let every = self.x_names.len().div_ceil(12).max(1);
            for (at, name) in self.x_names.iter().enumerate().step_by(every) {
                drawing.text([to_x(at as f64), bottom + 15.0], name, 9.0, SOFT, Anchor::Middle);
            }
        }
        let rungs = if self.logarithmic {
            decades(y0, y1)
        } else {
            ticks(y0, y1, 6)
        };
        for (y, label) in rungs {
            let at = to_y(y);
            drawing.line(vec![[left, at], [right, at]], GRID, 0.7, None, None);
            drawing.text([left - 6.0, at + 3.5], &label, 9.5, SOFT, Anchor::End);
        }
        let frame = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        drawing.line(frame.to_vec(), SOFT, 0.7, None, None);
        drawing.text(
            [(left + right) / 2.0, bottom + 33.0],
            &self.x_label,
            10.0,
            SOFT,
            Anchor::Middle,
        );
        drawing.upright([16.0, (top + bottom) / 2.0], &self.y_label, 10.0, SOFT);
        for limit in &self.limits {
            let y = to_y(limit.value);
            drawing.line(vec![[left, y], [right, y]], LIMIT, 1.0, Some([5.0, 3.0]), None);
            drawing.text([right - 4.0, y - 4.0], &limit.name, 9.0, LIMIT, Anchor::End);
        }
        for (number, curve) in self.curves.iter().enumerate() {
            let ink = COLORS[number % COLORS.len()];
            let clip = Some([left, top, right, bottom]);
            let path: Vec<[f32; 2]> = curve.points.iter().map(|[x, y]| [to_x(*x), to_y(*y)]).collect();
            for [x, y] in path.iter().filter(|at| at[0].is_finite() && at[1].is_finite()) {
                drawing.area([x - 1.8, y - 1.8, x + 1.8, y + 1.8], ink);
            }
            drawing.line(path, ink, 1.4, None, clip);
            if curve.name.is_empty() {
                continue;
            }
            let at = [left + (number % 2) as f32 * 280.0, 40.0 + 14.0 * (number / 2) as f32];
            drawing.line(vec![at, [at[0] + 16.0, at[1]]], ink, 2.0, None, None);
            drawing.text([at[0] + 20.0, at[1] + 3.5], &curve.name, 9.5, SOFT, Anchor::Start);
        }
        drawing
    }
}

impl Map {
    /// The map as a drawing.
    pub fn drawing(&self) -> Drawing {
        let (columns, rows) = (self.columns.len().max(1), self.rows.len().max(1));
        let letters = |names: &[String]| names.iter().map(|name| name.chars().count()).max().unwrap_or(0) as f32;
        let widest = self
            .cells
            .iter()
            .map(|cell| cell.text.chars().count())
            .max()
            .unwrap_or(0) as f32;
        let cell = [
            (720.0 / columns as f32).clamp(14.0, 64.0),
            (420.0 / rows as f32).clamp(12.0, 34.0),
        ];
        let (left, top) = (30.0 + 6.2 * letters(&self.rows), 56.0);
        let (right, bottom) = (left + columns as f32 * cell[0], top + rows as f32 * cell[1]);
        // names that are wider than a column stand every second or third column, or upright where that is still too much
        let every = ((6.4 * letters(&self.columns)) / cell[0]).ceil().max(1.0) as usize;
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
            width: (right + 24.0)
                .max(90.0 + 6.0 * longest)
                .max(30.0 + 7.6 * self.title.chars().count() as f32),
            height: bottom + below + 26.0 + 16.0 * self.legend.len() as f32,
            items: Vec::new(),
        };
        drawing.text([14.0, 22.0], &self.title, 13.0, INK, Anchor::Start);
        for (number, one) in self.cells.iter().enumerate() {
            let (column, row) = (number % columns, number / columns);
            let corner = [left + column as f32 * cell[0], bottom - (row + 1) as f32 * cell[1]];
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
        for column in 0..=columns {
            let x = left + column as f32 * cell[0];
            drawing.line(vec![[x, top], [x, bottom]], [255, 255, 255], 0.8, None, None);
        }
        for row in 0..=rows {
            let y = top + row as f32 * cell[1];
            drawing.line(vec![[left, y], [right, y]], [255, 255, 255], 0.8, None, None);
        }
        let frame = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        drawing.line(frame.to_vec(), SOFT, 0.7, None, None);
        for (column, name) in self.columns.iter().enumerate() {
            let x = left + (column as f32 + 0.5) * cell[0];
            if turned {
                let middle = bottom + 8.0 + 3.1 * letters(&self.columns);
                drawing.upright([x + 3.0, middle], name, 9.0, SOFT);
            } else if column % every == 0 {
                drawing.text([x, bottom + 14.0], name, 9.5, SOFT, Anchor::Middle);
            }
        }
        for (row, name) in self.rows.iter().enumerate() {
            let y = bottom - (row as f32 + 0.5) * cell[1] + 3.5;
            drawing.text([left - 6.0, y], name, 9.5, SOFT, Anchor::End);
        }
        drawing.text(
            [(left + right) / 2.0, bottom + below + 16.0],
            &self.x_label,
            10.0,
            SOFT,
            Anchor::Middle,
        );
        drawing.text([14.0, 44.0], &self.y_label, 10.0, SOFT, Anchor::Start);
        for (line, (shade, text)) in self.legend.iter().enumerate() {
            let y = bottom + below + 34.0 + 16.0 * line as f32;
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
        drawing
    }
}

impl Drawing {
    fn area(&mut self, corners: [f32; 4], color: Rgb) {
        self.items.push(Item::Area { corners, color });
    }

    fn upright(&mut self, at: [f32; 2], text: &str, size: f32, color: Rgb) {
        self.items.push(Item::Text {
            at,
            text: text.to_owned(),
            size,
            color,
            anchor: Anchor::Middle,
            upright: true,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::{png, svg};

    #[test]
    fn a_map_has_its_lowest_row_at_the_bottom() {
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

    #[test]
    fn a_logarithmic_chart_takes_zeros_and_gaps() {
        let chart = Chart {
            logarithmic: true,
            curves: vec![Curve {
                name: "error".into(),
                points: vec![[0.0, 0.0], [1.0, 1e-3], [2.0, f64::NAN], [3.0, 30.0]],
            }],
            limits: vec![Limit {
                value: 1.0,
                name: "limit".into(),
            }],
            bands: vec![Band {
                from: 0.0,
                to: 1.5,
                shade: Shade::Good(0.0),
            }],
            ..Chart::default()
        };
        let text = svg(&chart.drawing());
        assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
        for label in ["0.001", ">1<", ">100<", "#dff0e0"] {
            assert!(text.contains(label), "{label} {text}");
        }
    }
}
