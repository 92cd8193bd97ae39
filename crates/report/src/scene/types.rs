//! Scenes, bodies, shapes and cameras.

use super::model::{Model, Solid};
use crate::view::Signal;

/// Bodies and the cameras that look at them.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    /// The frame of all positions; empty for that of the first position that has one.
    pub frame: String,
    /// The up direction in the scene's frame; a zero vector for z.
    pub up: [f64; 3],
    /// The initial camera; unless given, one that shows the whole motion.
    pub camera: Option<Camera>,
    /// Other cameras, in the order of their buttons.
    pub cameras: Vec<Camera>,
    /// The bodies.
    pub bodies: Vec<Body>,
    /// The distances and angles displayed next to the picture.
    pub distances: Vec<Distance>,
}

/// A camera.
#[derive(Debug, Clone, Default)]
pub struct Camera {
    /// Identifier: short and stable.
    pub name: String,
    /// The text of its button.
    pub title: String,
    /// Its position, m; unless given, one from which the whole motion is visible.
    pub at: Option<[f64; 3]>,
    /// The target that it looks at.
    pub towards: Towards,
    /// The up direction of the picture; the scene's unless given.
    pub up: Option<[f64; 3]>,
    /// The body that carries it: position, target and `up` are then in the body's axes.
    pub on: Option<String>,
}

/// The target of a camera.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Towards {
    /// The centre of the motion.
    #[default]
    Middle,
    /// A point, m.
    Point([f64; 3]),
    /// A body: the camera moves with it, and its position is relative to it.
    Body(String),
}

/// The distance between the origins of two bodies, and the angle between their attitudes where both have one.
#[derive(Debug, Clone)]
pub struct Distance {
    /// Its description.
    pub label: String,
    /// One body.
    pub from: String,
    /// The other one.
    pub to: String,
}

/// Something that moves as a whole, or is fixed.
#[derive(Debug, Clone)]
pub struct Body {
    /// Its name in the scene.
    pub name: String,
    /// Its label.
    pub label: Option<String>,
    /// The position of its origin.
    pub position: Position,
    /// Its attitude; along the scene's axes unless given.
    pub attitude: Option<Attitude>,
    /// Its shapes.
    pub shapes: Vec<Shape>,
    /// Red, green, blue from 0 to 1, of every shape without a colour.
    pub colour: Option<[f64; 3]>,
    /// Whether only that of the first run is drawn where runs are overlaid.
    pub once: bool,
}

/// The position of a body.
#[derive(Debug, Clone)]
pub enum Position {
    /// A vector of three with the unit of a length.
    Field(Signal),
    /// x, y and z separately.
    Components([Component; 3]),
}

/// One component of a position.
#[derive(Debug, Clone)]
pub enum Component {
    /// A constant, m.
    Fixed(f64),
    /// A field with one element and the unit of a length.
    Field(Signal),
}

/// The attitude of a body.
#[derive(Debug, Clone)]
pub enum Attitude {
    /// A field with a quaternion.
    Quaternion {
        /// Four elements without unit.
        of: Signal,
        /// Whether the scalar part is last.
        scalar_last: bool,
    },
    /// A field with an angle about a fixed axis of the body.
    Angle {
        /// One element with the unit of an angle.
        of: Signal,
        /// The axis, of any length but zero.
        about: [f64; 3],
    },
}

/// A shape of a body.
#[derive(Debug, Clone)]
pub enum Shape {
    /// A solid.
    Solid(Solid),
    /// The links of a URDF.
    Model {
        /// The links.
        model: Model,
        /// Fields with the values of its moving joints, concatenated in the order of the file: rad, or m for a prismatic
        /// joint.
        joints: Vec<Signal>,
    },
    /// An arrow at the body's origin.
    Arrow(Arrow),
    /// The past and future path of the body's origin.
    Path(Path),
    /// The body's axes, of this length, m: x red, y green, z blue.
    Frame(f64),
}

/// An arrow along a field.
#[derive(Debug, Clone)]
pub struct Arrow {
    /// The fields it may have, in order of preference: a vector of three, or with `along` one element.
    pub of: Vec<Signal>,
    /// The direction of a field with one element.
    pub along: Option<[f64; 3]>,
    /// The axes of the components; unless given, the scene's where the field's frame is that of the scene or unknown, else
    /// the body's.
    pub axes: Option<Axes>,
    /// The length of the greatest value, m; unless given, a fraction of the whole motion.
    pub length: Option<f64>,
    /// Number of heads: two mark a torque.
    pub heads: u8,
    /// Its description.
    pub label: String,
    /// Red, green, blue from 0 to 1.
    pub colour: Option<[f64; 3]>,
}

/// The axes of a vector's components.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Axes {
    /// Those of the scene.
    Scene,
    /// Those of the body.
    Body,
}

/// The path of a body.
#[derive(Debug, Clone, Default)]
pub struct Path {
    /// Its description.
    pub label: String,
    /// Red, green, blue from 0 to 1.
    pub colour: Option<[f64; 3]>,
    /// Whether it is dashed.
    pub dashed: bool,
    /// Its width, in pixels.
    pub width: f64,
    /// Opacity from 0 to 1 of the past path.
    pub opacity: f64,
    /// Only the path within this time before the instant shown, s; all of the run unless given.
    pub last: Option<f64>,
}

impl Scene {
    /// The fields that the bodies refer to, each with its key in the table.
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

    /// The participants that bodies refer to, each with the key of the field.
    pub fn participants(&self) -> impl Iterator<Item = (String, &str)> {
        let signals = self.signals().into_iter();
        signals.filter_map(|(key, signal)| Some((key, signal.participant.as_deref()?)))
    }

    /// Replaces the solids and the model of the body called `name` by the URDF `text`; the fields of its joints are kept.
    ///
    /// # Errors
    /// There is no such body, or the text is not a model.
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
