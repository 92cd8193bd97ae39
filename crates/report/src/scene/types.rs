//! Scenes, bodies, shapes and cameras.

use super::model::{Model, Solid};
use crate::view::Signal;

/// Bodies and the cameras that look at them.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The frame of all positions; empty for that of the first position that has one.
    pub frame: String,
    /// Upwards in the scene's frame; a zero vector for z.
    pub up: [f64; 3],
    /// What the page shows at first; the whole motion unless given.
    pub camera: Option<Camera>,
    /// Other cameras, in the order of their buttons.
    pub cameras: Vec<Camera>,
    /// What is drawn.
    pub bodies: Vec<Body>,
    /// What is read off beside the picture.
    pub distances: Vec<Distance>,
}

/// Where somebody looks from.
#[derive(Debug, Clone, Default)]
pub struct Camera {
    /// Short and stable.
    pub name: String,
    /// What its button says.
    pub title: String,
    /// Its place, m; where the whole motion is seen unless given.
    pub at: Option<[f64; 3]>,
    /// What it looks at.
    pub towards: Towards,
    /// Upwards in the picture; the scene's unless given.
    pub up: Option<[f64; 3]>,
    /// The body that carries it: place, target and `up` are in the body's axes then.
    pub on: Option<String>,
}

/// What a camera looks at.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Towards {
    /// The middle of the motion.
    #[default]
    Middle,
    /// A point, m.
    Point([f64; 3]),
    /// A body: the camera goes along with it, and its place is measured from there.
    Body(String),
}

/// The distance between the origins of two bodies, and the angle between their attitudes where both have one.
#[derive(Debug, Clone)]
pub struct Distance {
    /// What it is, in words.
    pub label: String,
    /// One body.
    pub from: String,
    /// The other one.
    pub to: String,
}

/// Something that moves as a whole, or is at rest.
#[derive(Debug, Clone)]
pub struct Body {
    /// Its name in the scene.
    pub name: String,
    /// What is written beside it.
    pub label: Option<String>,
    /// Where its origin is.
    pub position: Position,
    /// How it is turned; along the scene's axes unless given.
    pub attitude: Option<Attitude>,
    /// What is drawn of it.
    pub shapes: Vec<Shape>,
    /// Red, green, blue from 0 to 1, of every shape that has none of its own.
    pub colour: Option<[f64; 3]>,
    /// Whether the first run's alone is drawn where runs lie over each other.
    pub once: bool,
}

/// Where a body is.
#[derive(Debug, Clone)]
pub enum Position {
    /// A vector of three with the unit of a length.
    Field(Signal),
    /// x, y and z, each for itself.
    Components([Component; 3]),
}

/// One component of a position.
#[derive(Debug, Clone)]
pub enum Component {
    /// m.
    Fixed(f64),
    /// A field with one element and the unit of a length.
    Field(Signal),
}

/// How a body is turned.
#[derive(Debug, Clone)]
pub enum Attitude {
    /// A field with a quaternion.
    Quaternion {
        /// Four elements without unit.
        of: Signal,
        /// Whether the scalar part is the last one.
        scalar_last: bool,
    },
    /// A field with an angle about an axis that the body keeps.
    Angle {
        /// One element with the unit of an angle.
        of: Signal,
        /// The axis, of any length but zero.
        about: [f64; 3],
    },
}

/// What is drawn of a body.
#[derive(Debug, Clone)]
pub enum Shape {
    /// A solid.
    Solid(Solid),
    /// The links of a URDF.
    Model {
        /// The links.
        model: Model,
        /// Fields with the values of its moving joints, one after the other in the order of the file: rad, or m where a joint slides.
        joints: Vec<Signal>,
    },
    /// An arrow at the body's origin.
    Arrow(Arrow),
    /// Where the body's origin was and will be.
    Path(Path),
    /// The body's axes, this long, m: x red, y green, z blue.
    Frame(f64),
}

/// An arrow along a field.
#[derive(Debug, Clone)]
pub struct Arrow {
    /// The fields it may have, in order of preference: a vector of three, or with `along` one element.
    pub of: Vec<Signal>,
    /// The direction of a field with one element.
    pub along: Option<[f64; 3]>,
    /// The axes of the field; unless given, the scene's where the field's frame is that of the scene or not known, else the body's.
    pub axes: Option<Axes>,
    /// How long the greatest value is drawn, m; a part of the whole motion unless given.
    pub length: Option<f64>,
    /// Heads: two mark a torque.
    pub heads: u8,
    /// What it is, in words.
    pub label: String,
    /// Red, green, blue from 0 to 1.
    pub colour: Option<[f64; 3]>,
}

/// In which axes a vector has its components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axes {
    /// Those of the scene.
    Scene,
    /// Those of the body.
    Body,
}

/// A line through the places of a body.
#[derive(Debug, Clone, Default)]
pub struct Path {
    /// What it is, in words.
    pub label: String,
    /// Red, green, blue from 0 to 1.
    pub colour: Option<[f64; 3]>,
    /// Whether it is dashed.
    pub dashed: bool,
    /// Its width, in pixels.
    pub width: f64,
    /// Opacity from 0 to 1 of what is behind the body.
    pub opacity: f64,
    /// Only the places of this long before the instant shown, s; all of the run unless given.
    pub last: Option<f64>,
}

impl Scene {
    /// The fields that the bodies name, each with its key below the table.
    fn signals(&self) -> Vec<(String, &Signal)> {
        let mut all = Vec::new();
        for body in &self.bodies {
            let key = |part: &str| format!("bodies.{}.{part}", body.name);
            match &body.position {
                Position::Field(of) => all.push((key("position"), of)),
                Position::Components(components) => all.extend(components.iter().filter_map(|one| match one {
                    Component::Field(of) => Some((key("position"), of)),
                    Component::Fixed(_) => None,
                })),
            }
            if let Some(Attitude::Quaternion { of, .. } | Attitude::Angle { of, .. }) = &body.attitude {
                all.push((key("attitude"), of));
            }
            for shape in &body.shapes {
                match shape {
                    Shape::Model { joints, .. } => all.extend(joints.iter().map(|of| (key("shape.joints"), of))),
                    Shape::Arrow(arrow) => all.extend(arrow.of.iter().map(|of| (key("shape.arrow"), of))),
                    Shape::Solid(_) | Shape::Path(_) | Shape::Frame(_) => {}
                }
            }
        }
        all
    }

    /// The participants that bodies name, each with the key of the field.
    pub fn participants(&self) -> impl Iterator<Item = (String, &str)> {
        let signals = self.signals().into_iter();
        signals.filter_map(|(key, signal)| Some((key, signal.participant.as_deref()?)))
    }

    /// Puts the URDF `text` in the place of the solids and the model of the body called `name`; it keeps the fields of the
    /// joints that it had.
    ///
    /// # Errors
    /// There is no such body, or the text is no model.
    pub fn replace_model(&mut self, name: &str, text: &str) -> Result<(), String> {
        let names: Vec<String> = self.bodies.iter().map(|body| format!("`{}`", body.name)).collect();
        let Some(body) = self.bodies.iter_mut().find(|body| body.name == name) else {
            return Err(match names.is_empty() {
                true => format!("the run has no scene with a body `{name}`"),
                false => format!("the scene has no body `{name}`; it has {}", names.join(", ")),
            });
        };
        let model = Model::read(text).map_err(|error| error.to_string())?;
        let joints = body.shapes.iter().find_map(|shape| match shape {
            Shape::Model { joints, .. } => Some(joints.clone()),
            _ => None,
        });
        body.shapes
            .retain(|shape| !matches!(shape, Shape::Solid(_) | Shape::Model { .. }));
        let joints = if model.moving() == 0 {
            Vec::new()
        } else {
            joints.unwrap_or_default()
        };
        body.shapes.push(Shape::Model { model, joints });
        Ok(())
    }
}
