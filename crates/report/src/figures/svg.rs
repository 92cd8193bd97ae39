//! A picture as SVG: text stays text, so that it can be searched and edited.

use std::fmt::Write;

use super::drawing::{Anchor, Drawing, Item};
use crate::markup::escape;

/// The picture as an SVG file.
pub fn svg(drawing: &Drawing) -> String {
    let (w, h) = (drawing.width, drawing.height);
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
         font-family=\"DejaVu Sans, Verdana, sans-serif\">\n<rect width=\"{w}\" height=\"{h}\" fill=\"#fff\"/>\n"
    );
    let mut clips = 0;
    for item in &drawing.items {
        match item {
            Item::Area {
                corners: [left, top, right, bottom],
                color: [r, g, b],
            } => {
                let (aw, ah) = (right - left, bottom - top);
                let _ = writeln!(
                    out,
                    "<rect x=\"{left:.2}\" y=\"{top:.2}\" width=\"{aw:.2}\" height=\"{ah:.2}\" fill=\"#{r:02x}{g:02x}{b:02x}\"/>"
                );
            }
            Item::Line {
                points,
                color: [r, g, b],
                width,
                dash,
                clip,
            } => {
                let path = path_of(points);
                let dash = dash.map_or(String::new(), |[on, off]| format!(" stroke-dasharray=\"{on} {off}\""));
                let mut clipped = String::new();
                if let Some([left, top, right, bottom]) = clip {
                    clips += 1;
                    let (cw, ch) = (right - left, bottom - top);
                    let _ = writeln!(
                        out,
                        "<clipPath id=\"c{clips}\"><rect x=\"{left}\" y=\"{top}\" width=\"{cw}\" height=\"{ch}\"/></clipPath>"
                    );
                    clipped = format!(" clip-path=\"url(#c{clips})\"");
                }
                let _ = writeln!(
                    out,
                    "<path d=\"{path}\" fill=\"none\" stroke=\"#{r:02x}{g:02x}{b:02x}\" stroke-width=\"{width}\" \
                     stroke-linejoin=\"round\"{dash}{clipped}/>"
                );
            }
            Item::Text {
                at: [x, y],
                text,
                size,
                color: [r, g, b],
                anchor,
                upright,
            } => {
                let anchor = match anchor {
                    Anchor::Start => "start",
                    Anchor::Middle => "middle",
                    Anchor::End => "end",
                };
                let turn = if *upright {
                    format!(" transform=\"rotate(-90 {x} {y})\"")
                } else {
                    String::new()
                };
                let _ = writeln!(
                    out,
                    "<text x=\"{x:.2}\" y=\"{y:.2}\" font-size=\"{size}\" fill=\"#{r:02x}{g:02x}{b:02x}\" \
                     text-anchor=\"{anchor}\"{turn}>{}</text>",
                    escape(text)
                );
            }
        }
    }
    out + "</svg>\n"
}

/// The path data through `points`, with a gap at each point that is not finite.
fn path_of(points: &[[f32; 2]]) -> String {
    let mut path = String::new();
    let mut up = true;
    for [x, y] in points {
        if x.is_finite() && y.is_finite() {
            // Hundredths of a point are finer than any printer.
            let _ = write!(path, "{}{x:.2} {y:.2}", if up { 'M' } else { 'L' });
        }
        up = !(x.is_finite() && y.is_finite());
    }
    path
}
