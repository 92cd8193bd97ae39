//! A picture as PNG: painted by tiny-skia, with letters from the outlines of the font that the program contains, so that a
//! figure looks the same on a machine without fonts.

use tiny_skia::{Color, FillRule, Mask, Paint, Path, PathBuilder, Pixmap, Rect, Stroke, StrokeDash, Transform};
use ttf_parser::{Face, OutlineBuilder};

use super::colors::Rgb;
use super::drawing::{Anchor, Drawing, Item};

const FONT: &[u8] = include_bytes!("font/DejaVuSans-subset.ttf");

/// The picture as a PNG file, `scale` pixels per point; `None` when it is too large or too small to paint.
pub fn png(drawing: &Drawing, scale: f32) -> Option<Vec<u8>> {
    let (width, height) = ((drawing.width * scale).round(), (drawing.height * scale).round());
    let mut canvas = Pixmap::new(width as u32, height as u32)?;
    canvas.fill(Color::WHITE);
    let font = Face::parse(FONT, 0).ok()?;
    for item in &drawing.items {
        match item {
            Item::Area {
                corners: [left, top, right, bottom],
                color,
            } => {
                if let Some(rect) = Rect::from_ltrb(*left, *top, *right, *bottom) {
                    canvas.fill_rect(rect, &paint(*color), Transform::from_scale(scale, scale), None);
                }
            }
            Item::Line {
                points,
                color,
                width,
                dash,
                clip,
            } => paint_line(&mut canvas, points, *color, *width, *dash, *clip, scale),
            Item::Text {
                at,
                text,
                size,
                color,
                anchor,
                upright,
            } => {
                if let Some((path, length)) = outline(&font, text, *size) {
                    let shift = match anchor {
                        Anchor::Start => 0.0,
                        Anchor::Middle => -length / 2.0,
                        Anchor::End => -length,
                    };
                    let turn = if *upright { -90.0 } else { 0.0 };
                    let place = Transform::from_translate(shift, 0.0)
                        .post_rotate(turn)
                        .post_translate(at[0], at[1])
                        .post_scale(scale, scale);
                    canvas.fill_path(&path, &paint(*color), FillRule::Winding, place, None);
                }
            }
        }
    }
    encode(&canvas)
}

fn paint(color: Rgb) -> Paint<'static> {
    let mut paint = Paint {
        anti_alias: true,
        ..Paint::default()
    };
    paint.set_color_rgba8(color[0], color[1], color[2], 255);
    paint
}

fn paint_line(
    canvas: &mut Pixmap,
    points: &[[f32; 2]],
    color: Rgb,
    width: f32,
    dash: Option<[f32; 2]>,
    clip: Option<[f32; 4]>,
    scale: f32,
) {
    let mut builder = PathBuilder::new();
    let mut up = true;
    for &[x, y] in points {
        let good = x.is_finite() && y.is_finite();
        if good && up {
            builder.move_to(x, y);
        } else if good {
            builder.line_to(x, y);
        }
        up = !good;
    }
    let Some(path) = builder.finish() else { return };
    let stroke = Stroke {
        width,
        line_join: tiny_skia::LineJoin::Round,
        dash: dash.and_then(|[on, off]| StrokeDash::new(vec![on, off], 0.0)),
        ..Stroke::default()
    };
    let mask = clip.and_then(|[left, top, right, bottom]| {
        let mut mask = Mask::new(canvas.width(), canvas.height())?;
        let rect = Rect::from_ltrb(left, top, right, bottom)?;
        let path = PathBuilder::from_rect(rect);
        mask.fill_path(&path, FillRule::Winding, false, Transform::from_scale(scale, scale));
        Some(mask)
    });
    canvas.stroke_path(
        &path,
        &paint(color),
        &stroke,
        Transform::from_scale(scale, scale),
        mask.as_ref(),
    );
}

/// The outlines of a text from the origin on, and its length.
fn outline(font: &Face<'_>, text: &str, size: f32) -> Option<(Path, f32)> {
    let scale = size / f32::from(font.units_per_em());
    let mut pen = Pen {
        builder: PathBuilder::new(),
        scale,
        x: 0.0,
    };
    for letter in text.chars() {
        let glyph = font.glyph_index(letter).or_else(|| font.glyph_index('?'))?;
        font.outline_glyph(glyph, &mut pen);
        pen.x += f32::from(font.glyph_hor_advance(glyph).unwrap_or(0)) * scale;
    }
    let length = pen.x;
    Some((pen.builder.finish()?, length))
}

struct Pen {
    builder: PathBuilder,
    scale: f32,
    x: f32,
}

impl Pen {
    /// Converts font units, y up, to points, y down.
    fn at(&self, x: f32, y: f32) -> (f32, f32) {
        (self.x + x * self.scale, -y * self.scale)
    }
}

impl OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.builder.move_to(x, y);
    }
    fn line_to(&mut self, x: f32, y: f32) {
        let (x, y) = self.at(x, y);
        self.builder.line_to(x, y);
    }
    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let ((x1, y1), (x, y)) = (self.at(x1, y1), self.at(x, y));
        self.builder.quad_to(x1, y1, x, y);
    }
    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        let ((x1, y1), (x2, y2), (x, y)) = (self.at(x1, y1), self.at(x2, y2), self.at(x, y));
        self.builder.cubic_to(x1, y1, x2, y2, x, y);
    }
    fn close(&mut self) {
        self.builder.close();
    }
}

/// The pixels, all of them opaque, as a PNG.
fn encode(canvas: &Pixmap) -> Option<Vec<u8>> {
    let rgb: Vec<u8> = canvas
        .pixels()
        .iter()
        .flat_map(|p| [p.red(), p.green(), p.blue()])
        .collect();
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, canvas.width(), canvas.height());
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().ok()?;
    writer.write_image_data(&rgb).ok()?;
    writer.finish().ok()?;
    Some(out)
}
