//! A figure as lines and texts.

use super::axis::ticks;
use super::{Anchor, Drawing, Item, Rgb};
use crate::page::Series;

pub(super) const INK: Rgb = [23, 32, 43];
pub(super) const SOFT: Rgb = [91, 103, 117];
pub(super) const GRID: Rgb = [226, 230, 235];
pub(super) const LIMIT: Rgb = [194, 47, 47];
/// Distinct also for most colour-blind readers, in print and on screen.
pub(super) const COLORS: [Rgb; 8] = [
    [11, 102, 179],
    [212, 84, 26],
    [20, 135, 90],
    [168, 73, 156],
    [184, 135, 0],
    [47, 163, 199],
    [106, 90, 205],
    [122, 106, 92],
];

const PANEL: [f32; 2] = [480.0, 260.0];
const LEFT: f32 = 62.0;
const RIGHT: f32 = 16.0;
const TOP: f32 = 38.0;
/// Distance of two lines of the legend.
const LINE: f32 = 14.0;
/// Width of a letter of the legend.
const LETTER: f32 = 6.2;
const BOTTOM: f32 = 40.0;

/// What one panel shows.
pub(crate) struct Panel<'a> {
    /// The name of the run, where there are several.
    pub(crate) name: String,
    /// Curves with their legend, the number of their colour, and whether they are dashed.
    pub(crate) series: Vec<(&'a Series, String, usize, bool)>,
}

/// Panels side by side with one vertical axis.
pub(crate) fn layout(title: &str, unit: &str, panels: &[Panel<'_>], limits: &[f64]) -> Drawing {
    let mut drawing = Drawing {
        width: panels.len().max(1) as f32 * PANEL[0],
        height: PANEL[1],
        items: Vec::new(),
    };
    let lines = panels
        .iter()
        .map(|panel| entries(panel).last().map_or(0, |(_, [_, line])| line + 1));
    let top = TOP + LINE * lines.max().unwrap_or(0).max(1) as f32;
    drawing.height += top - TOP - LINE;
    let all = || {
        panels
            .iter()
            .flat_map(|panel| &panel.series)
            .map(|(series, ..)| *series)
    };
    let (mut lo, mut hi) = extent(all().flat_map(|series| series.y.iter().copied()));
    let times = all().flat_map(|series| [0, series.y.len().saturating_sub(1)].map(|k| series.x(k)));
    let (start, end) = extent(times);
    let peak = lo.abs().max(hi.abs());
    let mut drawn: Vec<f64> = limits.iter().map(|limit| limit.abs()).collect();
    drawn.sort_by(f64::total_cmp);
    drawn.dedup();
    let far: Vec<String> = drawn
        .iter()
        .filter(|limit| **limit > 4.0 * peak)
        .map(f64::to_string)
        .collect();
    // A limit far above the curves would flatten them; it is told in words instead.
    drawn.retain(|limit| *limit <= 4.0 * peak);
    for limit in &drawn {
        (lo, hi) = (lo.min(-limit), hi.max(*limit));
    }
    let margin = if hi > lo {
        0.06 * (hi - lo)
    } else {
        0.1 * hi.abs().max(1e-12)
    };
    let (lo, hi) = (lo - margin, hi + margin);
    let heading = if unit == "1" {
        title.to_owned()
    } else {
        format!("{title} [{unit}]")
    };
    drawing.text([12.0, 20.0], &heading, 13.0, INK, Anchor::Start);
    for (at, panel) in panels.iter().enumerate() {
        let frame = Frame {
            left: at as f32 * PANEL[0] + LEFT,
            right: (at + 1) as f32 * PANEL[0] - RIGHT,
            top,
            bottom: drawing.height - BOTTOM,
            x: (start, if end > start { end } else { start + 1.0 }),
            y: (lo, hi),
        };
        drawing.axes(&frame);
        for limit in drawn.iter().flat_map(|limit| [*limit, -limit]) {
            let y = frame.y(limit);
            drawing.line(
                vec![[frame.left, y], [frame.right, y]],
                LIMIT,
                0.9,
                Some([5.0, 3.0]),
                None,
            );
        }
        if !far.is_empty() {
            let text = format!("limit ±{} {unit}, outside the view", far.join(", "));
            drawing.text([frame.right - 4.0, frame.bottom - 5.0], &text, 9.0, LIMIT, Anchor::End);
        }
        for (series, _, color, dashed) in &panel.series {
            let points = (0..series.y.len()).map(|k| [frame.x(series.x(k)), frame.y(series.y[k])]);
            let clip = Some([frame.left, frame.top, frame.right, frame.bottom]);
            let dash = dash(*dashed, *color);
            drawing.line(points.collect(), COLORS[color % COLORS.len()], 1.3, dash, clip);
        }
        drawing.legend(&frame, panel);
    }
    drawing
}

/// Least and greatest finite value; (0, 1) when there is none.
pub(super) fn extent(values: impl Iterator<Item = f64>) -> (f64, f64) {
    let (lo, hi) = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(lo, hi), value| {
            (lo.min(value), hi.max(value))
        });
    if lo <= hi { (lo, hi) } else { (0.0, 1.0) }
}

/// Where a panel lies on the paper and what it shows.
struct Frame {
    left: f32,
    right: f32,
    top: f32,
    bottom: f32,
    x: (f64, f64),
    y: (f64, f64),
}

impl Frame {
    fn x(&self, value: f64) -> f32 {
        self.left + ((value - self.x.0) / (self.x.1 - self.x.0)) as f32 * (self.right - self.left)
    }

    fn y(&self, value: f64) -> f32 {
        self.bottom - ((value - self.y.0) / (self.y.1 - self.y.0)) as f32 * (self.bottom - self.top)
    }
}

impl Drawing {
    pub(super) fn text(&mut self, at: [f32; 2], text: &str, size: f32, color: Rgb, anchor: Anchor) {
        self.items.push(Item::Text {
            at,
            text: text.to_owned(),
            size,
            color,
            anchor,
            upright: false,
        });
    }

    pub(super) fn line(
        &mut self,
        points: Vec<[f32; 2]>,
        color: Rgb,
        width: f32,
        dash: Option<[f32; 2]>,
        clip: Option<[f32; 4]>,
    ) {
        self.items.push(Item::Line {
            points,
            color,
            width,
            dash,
            clip,
        });
    }

    fn axes(&mut self, frame: &Frame) {
        for (value, label) in ticks(frame.x.0, frame.x.1, 6) {
            let x = frame.x(value);
            self.line(vec![[x, frame.top], [x, frame.bottom]], GRID, 0.7, None, None);
            self.text([x, frame.bottom + 14.0], &label, 9.5, SOFT, Anchor::Middle);
        }
        for (value, label) in ticks(frame.y.0, frame.y.1, 6) {
            let y = frame.y(value);
            self.line(vec![[frame.left, y], [frame.right, y]], GRID, 0.7, None, None);
            self.text([frame.left - 6.0, y + 3.5], &label, 9.5, SOFT, Anchor::End);
        }
        let (l, t, r, b) = (frame.left, frame.top, frame.right, frame.bottom);
        self.line(vec![[l, t], [r, t], [r, b], [l, b], [l, t]], SOFT, 0.7, None, None);
        self.text([(l + r) / 2.0, b + 30.0], "time [s]", 9.5, SOFT, Anchor::Middle);
    }

    fn legend(&mut self, frame: &Frame, panel: &Panel<'_>) {
        if !panel.name.is_empty() {
            self.text([frame.right, frame.top - 24.0], &panel.name, 10.5, INK, Anchor::End);
        }
        let listed = entries(panel);
        let lines = listed.last().map_or(0, |(_, [_, line])| line + 1);
        for (entry, [letters, line]) in listed {
            let (_, name, color, dashed) = &panel.series[entry];
            let x = frame.left + letters as f32 * LETTER;
            let y = frame.top - 10.0 - (lines - 1 - line) as f32 * LINE;
            let dash = dash(*dashed, *color);
            self.line(
                vec![[x, y], [x + 16.0, y]],
                COLORS[color % COLORS.len()],
                2.0,
                dash,
                None,
            );
            self.text([x + 20.0, y + 3.5], name, 9.5, SOFT, Anchor::Start);
        }
    }
}

/// Curves beyond the last colour take the first ones again, dotted.
fn dash(dashed: bool, color: usize) -> Option<[f32; 2]> {
    match (dashed, color >= COLORS.len()) {
        (true, _) => Some([5.0, 2.5]),
        (false, true) => Some([1.8, 1.8]),
        (false, false) => None,
    }
}

/// The entries of a legend: the number of the curve, and where it stands: letters from the left, and the line.
fn entries(panel: &Panel<'_>) -> Vec<(usize, [usize; 2])> {
    let width = ((PANEL[0] - LEFT - RIGHT) / LETTER) as usize;
    let (mut x, mut line, mut out) = (0, 0, Vec::new());
    for (curve, (_, name, ..)) in panel.series.iter().enumerate().filter(|(_, one)| !one.1.is_empty()) {
        let own = 5 + name.chars().count();
        if x > 0 && x + own > width {
            (x, line) = (0, line + 1);
        }
        out.push((curve, [x, line]));
        x += own;
    }
    out
}
