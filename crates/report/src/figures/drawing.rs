//! Layout of a figure: areas, lines and texts in points.

use super::colors::Rgb;

/// A picture on a white background, in points; y points down.
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
        /// Rotated by 90° to the left.
        upright: bool,
    },
}

/// The alignment of a text relative to its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

impl Drawing {
    pub(super) fn area(&mut self, corners: [f32; 4], color: Rgb) {
        self.items.push(Item::Area { corners, color });
    }

    pub(super) fn upright(&mut self, at: [f32; 2], text: &str, size: f32, color: Rgb) {
        self.items.push(Item::Text {
            at,
            text: text.to_owned(),
            size,
            color,
            anchor: Anchor::Middle,
            upright: true,
        });
    }

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
}
