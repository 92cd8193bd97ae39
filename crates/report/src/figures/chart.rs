//! Curves over a varied number.

use super::axis::{decades, extent, ticks};
use super::colors::{BROKEN, COLORS, GOOD, GRID, INK, LIMIT, SOFT, Shade};
use super::drawing::{Anchor, Drawing};

/// Curves over a varied number, with limits, and bands for the outcome of each point.
#[derive(Debug, Clone, Default)]
pub struct Chart {
    /// The heading.
    pub title: String,
    /// The varied quantity, with its unit.
    pub x_label: String,
    /// The quantity of the curves, with its unit.
    pub y_label: String,
    /// Names of the positions 0, 1, 2, … of the horizontal axis where they are not numbers.
    pub x_names: Vec<String>,
    /// Whether the horizontal axis is logarithmic; then all its values must be above zero.
    pub logarithmic_x: bool,
    /// Whether the vertical axis is logarithmic. Values that are not above zero are then drawn at its lower end.
    pub logarithmic: bool,
    /// The curves.
    pub curves: Vec<Curve>,
    /// Horizontal lines.
    pub limits: Vec<Limit>,
    /// Intervals of the horizontal axis.
    pub bands: Vec<Band>,
}

/// The style of a curve.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Stroke {
    /// A line with a mark at each point: each point was computed separately.
    #[default]
    Marked,
    /// A line.
    Plain,
    /// A dashed line: bounds and weights.
    Dashed,
}

/// A curve. A NaN is a gap.
#[derive(Debug, Clone, Default)]
pub struct Curve {
    /// Its label.
    pub name: String,
    /// Its points.
    pub points: Vec<[f64; 2]>,
    /// Its style.
    pub stroke: Stroke,
}

/// A horizontal line that curves should stay below.
#[derive(Debug, Clone)]
pub struct Limit {
    /// Its value.
    pub value: f64,
    /// Its label.
    pub name: String,
}

/// An interval of the horizontal axis.
#[derive(Debug, Clone, Copy)]
pub struct Band {
    /// Its start.
    pub from: f64,
    /// Its end.
    pub to: f64,
    /// The outcome there.
    pub shade: Shade,
}

/// Position and axis ranges of a chart; for a logarithmic axis, powers of ten.
struct Frame {
    left: f32,
    right: f32,
    top: f32,
    bottom: f32,
    x: (f64, f64),
    y: (f64, f64),
    logarithmic_x: bool,
    logarithmic: bool,
}

impl Frame {
    fn x(&self, x: f64) -> f32 {
        let x = if self.logarithmic_x { x.log10() } else { x };
        self.left + ((x - self.x.0) / (self.x.1 - self.x.0)) as f32 * (self.right - self.left)
    }

    fn y(&self, y: f64) -> f32 {
        let (y0, y1) = self.y;
        let y = if self.logarithmic { y.max(1e-300).log10() } else { y };
        self.bottom - ((y.max(y0) - y0) / (y1 - y0)) as f32 * (self.bottom - self.top)
    }
}

impl Chart {
    /// The chart as a drawing.
    pub fn drawing(&self) -> Drawing {
        let (width, height) = (640.0, 360.0);
        let mut drawing = Drawing {
            width,
            height,
            items: Vec::new(),
        };
        drawing.text([14.0, 22.0], &self.title, 13.0, INK, Anchor::Start);
        let frame = self.frame(width, height);
        for band in &self.bands {
            let fill = match band.shade {
                Shade::Good(_) => GOOD,
                Shade::Broken => BROKEN,
                Shade::Bad | Shade::Unknown => continue,
            };
            drawing.area([frame.x(band.from), frame.top, frame.x(band.to), frame.bottom], fill);
        }
        self.draw_axes(&mut drawing, &frame);
        for limit in &self.limits {
            let y = frame.y(limit.value);
            drawing.line(
                vec![[frame.left, y], [frame.right, y]],
                LIMIT,
                1.0,
                Some([5.0, 3.0]),
                None,
            );
            drawing.text([frame.right - 4.0, y - 4.0], &limit.name, 9.0, LIMIT, Anchor::End);
        }
        for (number, curve) in self.curves.iter().enumerate() {
            curve.draw(number, &mut drawing, &frame);
        }
        drawing
    }

    fn frame(&self, width: f32, height: f32) -> Frame {
        let points = || self.curves.iter().flat_map(|curve| &curve.points);
        let bands = self.bands.iter().flat_map(|band| [band.from, band.to]);
        let along = points().map(|point| point[0]).chain(bands);
        let x = if self.logarithmic_x {
            whole_decades(along)
        } else {
            let (x0, x1) = extent(along);
            (x0, if x1 > x0 { x1 } else { x0 + 1.0 })
        };
        let limits = self.limits.iter().map(|limit| limit.value);
        let values = points().map(|point| point[1]).chain(limits);
        let y = if self.logarithmic {
            whole_decades(values)
        } else {
            let (lo, hi) = extent(values.chain([0.0]));
            (lo, if hi > lo { hi + 0.06 * (hi - lo) } else { lo + 1.0 })
        };
        Frame {
            left: 74.0,
            right: width - 20.0,
            top: 46.0 + 14.0 * self.curves.len().div_ceil(2) as f32,
            bottom: height - 46.0,
            x,
            y,
            logarithmic_x: self.logarithmic_x,
            logarithmic: self.logarithmic,
        }
    }

    fn draw_axes(&self, drawing: &mut Drawing, frame: &Frame) {
        let &Frame {
            left,
            right,
            top,
            bottom,
            ..
        } = frame;
        if self.x_names.is_empty() {
            let columns = if self.logarithmic_x {
                decades(frame.x.0, frame.x.1)
            } else {
                ticks(frame.x.0, frame.x.1, 10)
            };
            for (x, label) in columns {
                drawing.line(vec![[frame.x(x), top], [frame.x(x), bottom]], GRID, 0.7, None, None);
                drawing.text([frame.x(x), bottom + 15.0], &label, 9.5, SOFT, Anchor::Middle);
            }
        } else {
            let every = self.x_names.len().div_ceil(12).max(1);
            for (at, name) in self.x_names.iter().enumerate().step_by(every) {
                drawing.text([frame.x(at as f64), bottom + 15.0], name, 9.0, SOFT, Anchor::Middle);
            }
        }
        let rungs = if self.logarithmic {
            decades(frame.y.0, frame.y.1)
        } else {
            ticks(frame.y.0, frame.y.1, 6)
        };
        for (y, label) in rungs {
            let at = frame.y(y);
            drawing.line(vec![[left, at], [right, at]], GRID, 0.7, None, None);
            drawing.text([left - 6.0, at + 3.5], &label, 9.5, SOFT, Anchor::End);
        }
        let edge = [[left, top], [right, top], [right, bottom], [left, bottom], [left, top]];
        drawing.line(edge.to_vec(), SOFT, 0.7, None, None);
        drawing.text(
            [(left + right) / 2.0, bottom + 33.0],
            &self.x_label,
            10.0,
            SOFT,
            Anchor::Middle,
        );
        drawing.upright([16.0, (top + bottom) / 2.0], &self.y_label, 10.0, SOFT);
    }
}

impl Curve {
    /// Draws curve number `number` of a chart, with its entry in the legend.
    fn draw(&self, number: usize, drawing: &mut Drawing, frame: &Frame) {
        let ink = COLORS[number % COLORS.len()];
        let clip = Some([frame.left, frame.top, frame.right, frame.bottom]);
        let path: Vec<[f32; 2]> = self.points.iter().map(|[x, y]| [frame.x(*x), frame.y(*y)]).collect();
        let there = |at: &&[f32; 2]| self.stroke == Stroke::Marked && at[0].is_finite() && at[1].is_finite();
        for [x, y] in path.iter().filter(there) {
            drawing.area([x - 1.8, y - 1.8, x + 1.8, y + 1.8], ink);
        }
        let dash = (self.stroke == Stroke::Dashed).then_some([5.0, 2.5]);
        drawing.line(path, ink, 1.4, dash, clip);
        if self.name.is_empty() {
            return;
        }
        let at = [
            frame.left + (number % 2) as f32 * 280.0,
            40.0 + 14.0 * (number / 2) as f32,
        ];
        drawing.line(vec![at, [at[0] + 16.0, at[1]]], ink, 2.0, dash, None);
        drawing.text([at[0] + 20.0, at[1] + 3.5], &self.name, 9.5, SOFT, Anchor::Start);
    }
}

/// The range of powers of ten that includes all values above zero, at least one decade.
fn whole_decades(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (lo, hi) = extent(values.filter(|value| *value > 0.0).map(f64::log10));
    let (lo, hi) = (lo.floor(), hi.ceil());
    (lo, if hi > lo { hi } else { lo + 1.0 })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::svg;

    #[test]
    fn logarithmic_chart_accepts_zeros_and_gaps() {
        let chart = Chart {
            logarithmic: true,
            curves: vec![Curve {
                name: "error".into(),
                points: vec![[0.0, 0.0], [1.0, 1e-3], [2.0, f64::NAN], [3.0, 30.0]],
                ..Curve::default()
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

    #[test]
    fn logarithmic_axis_spaces_decades_evenly() {
        let curve = |stroke| Curve {
            name: String::new(),
            points: vec![[1e-2, 1.0], [1.0, 2.0], [1e2, 1.0]],
            stroke,
        };
        let chart = Chart {
            logarithmic_x: true,
            logarithmic: true,
            curves: vec![curve(Stroke::Plain), curve(Stroke::Dashed)],
            ..Chart::default()
        };
        let frame = chart.frame(640.0, 360.0);
        assert!((frame.x(1.0) - (frame.x(1e-2) + frame.x(1e2)) / 2.0).abs() < 1e-3);
        let text = svg(&chart.drawing());
        assert!(text.contains(">0.01<") && text.contains(">100<"), "{text}");
        // Rectangles are the background or a clip, not marks; one of the curves is dashed.
        assert_eq!(text.matches("<rect").count(), 1 + 2, "{text}");
        assert_eq!(text.matches("stroke-dasharray").count(), 1, "{text}");
    }
}
