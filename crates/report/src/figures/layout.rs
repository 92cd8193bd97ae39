//! A figure as lines and texts.

use super::axis::{extent, ticks};
use super::colors::{COLORS, GRID, INK, LIMIT, SOFT};
use super::drawing::{Anchor, Drawing};
use crate::page::Series;
use crate::view::{Axis, BoundFigure, best};

const PANEL: [f32; 2] = [480.0, 260.0];
const LEFT: f32 = 62.0;
const RIGHT: f32 = 16.0;
const TOP: f32 = 38.0;
/// Line spacing of the legend.
const LINE: f32 = 14.0;
/// Letter width of the legend.
const LETTER: f32 = 6.2;
const BOTTOM: f32 = 40.0;

/// The content of one panel.
pub(crate) struct Panel<'a> {
    /// The name of the run, where there are several.
    pub(crate) name: String,
    /// Curves with their labels, the number of their colour, and whether they are dashed.
    pub(crate) series: Vec<(&'a Series, String, usize, bool)>,
}

/// Panels side by side that share one vertical axis.
pub(crate) fn layout(figure: &BoundFigure, panels: &[Panel<'_>]) -> Drawing {
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
    let (lo, hi) = extent(all().flat_map(|series| series.y.iter().copied()));
    let start_end = match &figure.against {
        Some(_) => extent(all().flat_map(|series| series.x.iter().flatten().copied())),
        None => extent(all().flat_map(|series| [0, series.y.len().saturating_sub(1)].map(|k| series.t(k)))),
    };
    let (near, far) = limits(figure, lo.abs().max(hi.abs()));
    let (lo, hi) = near
        .iter()
        .fold((lo, hi), |(lo, hi), limit| (lo.min(*limit), hi.max(*limit)));
    let (factor, unit) = best(&figure.axis.scales, lo.abs().max(hi.abs()));
    let (along, along_unit) = match &figure.against {
        Some(axis) => best(&axis.scales, start_end.0.abs().max(start_end.1.abs())),
        None => (1.0, "s"),
    };
    let x = widened(start_end, 0.0, along);
    let y = widened((lo, hi), 0.06, factor);
    drawing.text([12.0, 20.0], &heading(figure, unit), 13.0, INK, Anchor::Start);
    let below = match &figure.against {
        Some(axis) => named(&axis.name, axis, along_unit),
        None => "time [s]".to_owned(),
    };
    for (at, panel) in panels.iter().enumerate() {
        let frame = Frame {
            left: at as f32 * PANEL[0] + LEFT,
            right: (at + 1) as f32 * PANEL[0] - RIGHT,
            top,
            bottom: drawing.height - BOTTOM,
            x,
            y,
        };
        drawing.axes(&frame, &below);
        for limit in &near {
            let y = frame.y(limit / factor);
            let points = vec![[frame.left, y], [frame.right, y]];
            drawing.line(points, LIMIT, 0.9, Some([5.0, 3.0]), None);
        }
        if !far.is_empty() {
            let text = format!("{}, outside the view", far.join(", "));
            drawing.text([frame.right - 4.0, frame.bottom - 5.0], &text, 9.0, LIMIT, Anchor::End);
        }
        for (series, _, color, dashed) in &panel.series {
            let points = (0..series.y.len()).map(|k| [frame.x(series.x(k) / along), frame.y(series.y[k] / factor)]);
            let clip = Some([frame.left, frame.top, frame.right, frame.bottom]);
            let points = if series.step {
                zero_order_hold(points.collect())
            } else {
                points.collect()
            };
            drawing.line(points, COLORS[color % COLORS.len()], 1.3, dash(*dashed, *color), clip);
        }
        drawing.legend(&frame, panel);
    }
    drawing
}

/// The limits that are drawn, and the others as text: a limit far from the curves would flatten them.
fn limits(figure: &BoundFigure, peak: f64) -> (Vec<f64>, Vec<String>) {
    let (near, far): (Vec<_>, Vec<_>) = figure.limits.iter().partition(|limit| limit.y.abs() <= 4.0 * peak);
    let mut values: Vec<f64> = near.iter().map(|limit| limit.y).collect();
    values.sort_by(f64::total_cmp);
    values.dedup();
    let mut words: Vec<String> = Vec::new();
    for limit in far {
        let (factor, unit) = best(&figure.axis.scales, limit.y.abs());
        let both = figure.limits.iter().any(|other| other.y == -limit.y && limit.y != 0.0);
        let sign = if both { "±" } else { "" };
        let value = if both { limit.y.abs() } else { limit.y };
        let text = format!("{} {sign}{} {unit}", limit.text, value / factor);
        if !words.contains(&text) {
            words.push(text);
        }
    }
    (values, words)
}

/// The range of an axis in units of `factor`, with a margin.
fn widened((lo, hi): (f64, f64), margin: f64, factor: f64) -> (f64, f64) {
    if hi > lo {
        let pad = margin * (hi - lo);
        ((lo - pad) / factor, (hi + pad) / factor)
    } else {
        let pad = if margin > 0.0 { 0.1 * hi.abs().max(1e-12) } else { 0.5 };
        ((lo - pad) / factor, (hi + pad) / factor)
    }
}

fn heading(figure: &BoundFigure, unit: &str) -> String {
    let whole = match figure.signal {
        true => format!("{}.{}", figure.group, figure.title),
        false => figure.title.clone(),
    };
    named(&whole, &figure.axis, unit)
}

/// A name with unit and frame.
fn named(name: &str, axis: &Axis, unit: &str) -> String {
    let frame = if axis.frame.is_empty() {
        String::new()
    } else {
        format!(" in {}", axis.frame)
    };
    match (unit, &*frame) {
        ("", "") => name.to_owned(),
        ("", frame) => format!("{name}{frame}"),
        (unit, frame) => format!("{name} [{unit}]{frame}"),
    }
}

/// The same points as a zero-order hold.
fn zero_order_hold(points: Vec<[f32; 2]>) -> Vec<[f32; 2]> {
    let mut out: Vec<[f32; 2]> = Vec::with_capacity(2 * points.len());
    for point in points {
        if let Some([_, y]) = out.last() {
            out.push([point[0], *y]);
        }
        out.push(point);
    }
    out
}

/// Position and axis ranges of a panel.
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
    fn axes(&mut self, frame: &Frame, below: &str) {
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
        self.text([(l + r) / 2.0, b + 30.0], below, 9.5, SOFT, Anchor::Middle);
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

/// Curves beyond the last colour reuse the first ones, dotted.
fn dash(dashed: bool, color: usize) -> Option<[f32; 2]> {
    match (dashed, color >= COLORS.len()) {
        (true, _) => Some([5.0, 2.5]),
        (false, true) => Some([1.8, 1.8]),
        (false, false) => None,
    }
}

/// The entries of a legend: the number of the curve, and its position: letters from the left, and the line.
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
