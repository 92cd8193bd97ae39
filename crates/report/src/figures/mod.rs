//! Figures as files: each is laid out once as lines and texts, then written as SVG or painted into a PNG.

mod axis;
mod chart;
mod colors;
mod drawing;
mod layout;
mod map;
mod png;
mod svg;

pub use chart::{Band, Chart, Curve, Limit, Stroke};
pub use colors::{Rgb, Shade};
pub use drawing::Drawing;
pub(crate) use layout::{Panel, layout};
pub use map::{Map, MapCell};
pub use png::png;
pub use svg::svg;
