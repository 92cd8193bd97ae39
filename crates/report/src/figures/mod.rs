//! Figures as files: laid out once into lines and texts, then written as SVG or painted into a PNG.

mod axis;
mod chart;
mod layout;
mod png;
mod svg;

pub use chart::{Band, Chart, Curve, Limit, Map, MapCell, Shade};
pub(crate) use layout::{Panel, layout};
pub use png::png;
pub use svg::svg;

/// A colour: red, green, blue.
pub type Rgb = [u8; 3];

/// A picture on white, in points; y points down.
#[derive(Debug, Clone)]
pub struct Drawing {
    pub(crate) width: f32,
    pub(crate) height: f32,
    pub(crate) items: Vec<Item>,
}

/// A part of a picture; later parts cover earlier ones.
#[derive(Debug, Clone)]
pub(crate) enum Item {
    /// A rectangle (left, top, right, bottom) without an edge.
    Area { corners: [f32; 4], color: Rgb },
    /// Connected lines, cut off at `clip` (left, top, right, bottom) where there is one. A NaN is a gap.
    Line {
        points: Vec<[f32; 2]>,
        color: Rgb,
        width: f32,
        dash: Option<[f32; 2]>,
        clip: Option<[f32; 4]>,
    },
    /// A text whose baseline starts, is centred or ends at a point.
    Text {
        at: [f32; 2],
        text: String,
        size: f32,
        color: Rgb,
        anchor: Anchor,
        /// Turned a quarter to the left.
        upright: bool,
    },
}

/// Where a text stands relative to its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}
