//! Binding of a scene to the streams of a run.

use lockstep::units;
use serde::Serialize;
use tape::StreamSpec;

use super::channel::{Channel, ChannelElement, ChannelKind, Channels};
use super::model::Model;
use super::types::{Arrow, Attitude, Axes, Body, Camera, Component, Position, Scene, Shape, Towards};
use crate::view::{Mistake, Signal};

/// A scene with the channels that move it, as input of the page.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct BoundScene {
    pub(crate) frame: String,
    up: [f64; 3],
    bodies: Vec<BoundBody>,
    cameras: Vec<BoundCamera>,
    /// Whether the first camera is the initial one.
    chosen: bool,
    distances: Vec<BoundDistance>,
    #[serde(skip)]
    pub(crate) channels: Channels,
    /// The leading stream, whose samples are the instants.
    #[serde(skip)]
    pub(crate) lead: usize,
}

/// A body; channels and bodies are given by their index.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct BoundBody {
    pub(crate) name: String,
    label: Option<String>,
    pub(crate) position: usize,
    pub(crate) attitude: Option<usize>,
    pub(crate) models: Vec<BoundModel>,
    arrows: Vec<BoundArrow>,
    paths: Vec<BoundPath>,
    axes: Option<f64>,
    once: bool,
    /// Whether it never moves.
    fixed: bool,
}

/// Links, and the channel with the values of their joints.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct BoundModel {
    #[serde(flatten)]
    pub(crate) model: Model,
    pub(crate) joints: Option<usize>,
}

#[derive(Debug, Clone, Serialize)]
struct BoundArrow {
    of: usize,
    body: bool,
    length: Option<f64>,
    heads: u8,
    label: String,
    unit: String,
    colour: Option<[f64; 3]>,
}

#[derive(Debug, Clone, Serialize)]
struct BoundPath {
    label: String,
    colour: Option<[f64; 3]>,
    dashed: bool,
    width: f64,
    opacity: f64,
    last: Option<f64>,
}

#[derive(Debug, Clone, Serialize)]
struct BoundCamera {
    name: String,
    title: String,
    at: Option<[f64; 3]>,
    towards: Option<[f64; 3]>,
    follow: Option<usize>,
    on: Option<usize>,
    up: Option<[f64; 3]>,
}

#[derive(Debug, Clone, Serialize)]
struct BoundDistance {
    label: String,
    from: usize,
    to: usize,
}

/// Binds a scene. A body whose fields the streams do not have is left out, and reported.
pub(crate) fn bind(scene: &Scene, streams: &[StreamSpec]) -> (Option<BoundScene>, Vec<Mistake>) {
    let mut binder = Binder {
        streams,
        frame: scene.frame.clone(),
        channels: Channels::default(),
        mistakes: Vec::new(),
    };
    let bodies: Vec<BoundBody> = scene.bodies.iter().filter_map(|body| binder.body(body)).collect();
    let Binder {
        frame,
        channels,
        mut mistakes,
        ..
    } = binder;
    let place = |name: &String| bodies.iter().position(|body| body.name == *name);
    let cameras = scene.camera.iter().chain(&scene.cameras);
    let cameras: Vec<BoundCamera> = cameras.filter_map(|camera| bound_camera(camera, &place)).collect();
    let distances = scene.distances.iter().filter_map(|one| {
        Some(BoundDistance {
            label: one.label.clone(),
            from: place(&one.from)?,
            to: place(&one.to)?,
        })
    });
    let Some(lead) = channels.lead(streams) else {
        if mistakes.is_empty() {
            let reason =
                "nothing in the scene follows a field: write position = \"PARTICIPANT.OUTPUT.FIELD\" in a body";
            mistakes.push(Mistake::new("bodies".into(), reason));
        }
        return (None, mistakes);
    };
    let bound = BoundScene {
        chosen: scene
            .camera
            .as_ref()
            .is_some_and(|one| cameras.iter().any(|camera| camera.name == one.name)),
        up: if scene.up == [0.0; 3] {
            [0.0, 0.0, 1.0]
        } else {
            scene.up
        },
        distances: distances.collect(),
        frame,
        cameras,
        bodies: bodies.clone(),
        channels,
        lead,
    };
    (Some(bound), mistakes)
}

/// A camera; none where the body that carries it, or that it looks at, is left out.
fn bound_camera(camera: &Camera, place: &impl Fn(&String) -> Option<usize>) -> Option<BoundCamera> {
    let on = match &camera.on {
        Some(name) => Some(place(name)?),
        None => None,
    };
    let (towards, follow) = match &camera.towards {
        Towards::Middle => (None, None),
        Towards::Point(at) => (Some(*at), None),
        Towards::Body(name) => (None, Some(place(name)?)),
    };
    Some(BoundCamera {
        name: camera.name.clone(),
        title: camera.title.clone(),
        at: camera.at,
        up: camera.up,
        towards,
        follow,
        on,
    })
}

impl BoundScene {
    /// The bodies that are drawn.
    pub(crate) fn bodies(&self) -> &[BoundBody] {
        &self.bodies
    }
}

/// Elements of a field in the unit of a channel.
struct FieldElements {
    parts: Vec<ChannelElement>,
    frame: String,
    name: String,
    unit: String,
}

struct Binder<'a> {
    streams: &'a [StreamSpec],
    /// The frame of the scene, once a position has determined it.
    frame: String,
    channels: Channels,
    mistakes: Vec<Mistake>,
}

impl Binder<'_> {
    fn body(&mut self, body: &Body) -> Option<BoundBody> {
        let key = |part: &str| format!("bodies.{}.{part}", body.name);
        let position = self.position(&body.position);
        let position = self.record_mistake(key("position"), position);
        let attitude = body.attitude.as_ref().map(|attitude| {
            let attitude = self.attitude(attitude);
            self.record_mistake(key("attitude"), attitude)
        });
        let complete = position.is_some() && attitude != Some(None);
        let still = |one: &Component| matches!(one, Component::Fixed(_));
        let mut bound = BoundBody {
            name: body.name.clone(),
            label: body.label.clone(),
            position: position.unwrap_or_default(),
            attitude: attitude.flatten(),
            once: body.once,
            fixed: matches!(&body.position, Position::Components(all) if all.iter().all(still)),
            ..BoundBody::default()
        };
        let colour = body.colour;
        let mut solids = Vec::new();
        for shape in &body.shapes {
            let made = match shape {
                Shape::Solid(solid) => {
                    let mut solid = solid.clone();
                    solid.rgba = solid.rgba.or(colour.map(|[r, g, b]| [r, g, b, 1.0]));
                    solids.push(solid);
                    Ok(())
                }
                Shape::Model { model, joints } => self.model(model, joints).map(|model| bound.models.push(model)),
                Shape::Arrow(arrow) => self.arrow(arrow, body).map(|arrow| bound.arrows.push(arrow)),
                Shape::Path(path) => {
                    bound.paths.push(BoundPath {
                        label: path.label.clone(),
                        colour: path.colour.or(colour),
                        dashed: path.dashed,
                        width: path.width,
                        opacity: path.opacity,
                        last: path.last,
                    });
                    Ok(())
                }
                Shape::Frame(length) => {
                    bound.axes = Some(*length);
                    Ok(())
                }
            };
            if let Err((part, reason)) = made {
                self.record_mistake::<()>(key(part), Err(reason));
            }
        }
        if !solids.is_empty() {
            bound.models.push(BoundModel {
                model: Model::of_solids(&body.name, solids),
                joints: None,
            });
        }
        complete.then_some(bound)
    }

    /// Returns the value of a result; records an error as a mistake.
    fn record_mistake<T>(&mut self, key: String, found: Result<T, String>) -> Option<T> {
        found
            .map_err(|reason| self.mistakes.push(Mistake::new(key, reason)))
            .ok()
    }

    /// The elements of a field, in `unit` where one is given.
    fn find(&self, signal: &Signal, count: usize, unit: Option<&str>, what: &str) -> Result<FieldElements, String> {
        let (stream, slice) = signal
            .find(self.streams)
            .ok_or_else(|| signal.alternatives_text(self.streams))?;
        let name = format!("{}.{}", self.streams[stream].name(), signal.names.join(", "));
        if slice.len != count {
            let have = if slice.len == 1 {
                "one element".to_owned()
            } else {
                format!("{} elements", slice.len)
            };
            let need = if count == 1 {
                "one".to_owned()
            } else {
                count.to_string()
            };
            return Err(format!("`{name}` has {have}, and {what} needs {need}"));
        }
        let own = &slice.field.unit;
        let scale = match unit {
            Some(unit) if unit != own => {
                let converted = units::convert(&format!("1 {own}"), unit);
                let refused = |_| format!("`{name}` is in `{own}`, and {what} needs a unit such as `{unit}`");
                converted.map_err(refused)?.0[0]
            }
            _ => 1.0,
        };
        let parts = (0..count).map(|index| ChannelElement::Element {
            stream,
            field: slice.field.clone(),
            index: slice.from + index,
            scale,
        });
        Ok(FieldElements {
            parts: parts.collect(),
            frame: slice.field.frame.clone(),
            unit: own.clone(),
            name,
        })
    }

    /// Rejects a field of another frame than the scene's; the first position that has a frame determines the scene's.
    fn in_frame(&mut self, found: &FieldElements) -> Result<(), String> {
        if self.frame.is_empty() {
            self.frame.clone_from(&found.frame);
        }
        if found.frame.is_empty() || found.frame == self.frame {
            return Ok(());
        }
        Err(format!(
            "`{}` is in frame `{}`, and the scene is drawn in `{}`: take a field in that frame, or set `frame` of the scene",
            found.name, found.frame, self.frame
        ))
    }

    fn position(&mut self, position: &Position) -> Result<usize, String> {
        let mut parts = Vec::with_capacity(3);
        match position {
            Position::Field(of) => {
                let found = self.find(
                    of,
                    3,
                    Some("m"),
                    "a position (a list of three may take single elements)",
                )?;
                self.in_frame(&found)?;
                parts = found.parts;
            }
            Position::Components(components) => {
                for component in components {
                    match component {
                        Component::Fixed(x) => parts.push(ChannelElement::Fixed(*x)),
                        Component::Field(of) => {
                            let found = self.find(of, 1, Some("m"), "a component of a position")?;
                            self.in_frame(&found)?;
                            parts.extend(found.parts);
                        }
                    }
                }
            }
        }
        let kind = ChannelKind::Vector;
        Ok(self.channels.intern(Channel { kind, parts }))
    }

    fn attitude(&mut self, attitude: &Attitude) -> Result<usize, String> {
        let (kind, parts) = match attitude {
            Attitude::Quaternion { of, scalar_last } => {
                let mut found = self.find(of, 4, Some("1"), "a quaternion")?;
                self.in_frame(&found)?;
                if *scalar_last {
                    found.parts.rotate_right(1);
                }
                (ChannelKind::Attitude, found.parts)
            }
            Attitude::Angle { of, about } => {
                let found = self.find(of, 1, Some("rad"), "an angle")?;
                self.in_frame(&found)?;
                (ChannelKind::Turn(unit(*about)), found.parts)
            }
        };
        Ok(self.channels.intern(Channel { kind, parts }))
    }

    fn model(&mut self, model: &Model, joints: &[Signal]) -> Result<BoundModel, (&'static str, String)> {
        let refuse = |reason| ("shape.joints", reason);
        let sliding = model.sliding();
        let mut parts = Vec::new();
        for signal in joints {
            let (_, slice) = signal
                .find(self.streams)
                .ok_or_else(|| refuse(signal.alternatives_text(self.streams)))?;
            let slides = sliding.get(parts.len()).copied().unwrap_or(false);
            let unit = if slides { "m" } else { "rad" };
            let what = format!("joint {} of the model", parts.len() + 1);
            parts.extend(self.find(signal, slice.len, Some(unit), &what).map_err(refuse)?.parts);
        }
        if parts.len() != sliding.len() && !joints.is_empty() {
            return Err(refuse(format!(
                "the fields have {} elements, and the model has {} moving joints: name a field or an element for each of them",
                parts.len(),
                sliding.len()
            )));
        }
        let kind = ChannelKind::Vector;
        let joints = (!parts.is_empty()).then(|| self.channels.intern(Channel { kind, parts }));
        Ok(BoundModel {
            model: model.clone(),
            joints,
        })
    }

    fn arrow(&mut self, arrow: &Arrow, body: &Body) -> Result<BoundArrow, (&'static str, String)> {
        let refuse = |reason| ("shape.arrow", reason);
        let there = arrow.of.iter().find(|of| of.find(self.streams).is_some());
        let of = there
            .or(arrow.of.first())
            .ok_or_else(|| refuse("it has no field".to_owned()))?;
        let found = match arrow.along {
            None => self.find(of, 3, None, "an arrow without `along`").map_err(refuse)?,
            Some(direction) => {
                let mut found = self.find(of, 1, None, "an arrow with `along`").map_err(refuse)?;
                let [part] = &found.parts[..] else {
                    return Err(refuse("it has no element".to_owned()));
                };
                found.parts = unit(direction).map(|along| scaled(part, along)).into();
                found
            }
        };
        let own = found.frame.is_empty() || found.frame == self.frame;
        let axes = match (arrow.axes, body.attitude.is_some()) {
            (Some(Axes::Body), false) => {
                let reason =
                    "the body has no attitude, so it has no axes of its own: give it one, or write axes = \"scene\"";
                return Err(refuse(reason.to_owned()));
            }
            (Some(axes), _) => axes,
            (None, _) if own => Axes::Scene,
            (None, true) => Axes::Body,
            (None, false) => {
                return Err(refuse(format!(
                    "`{}` is in frame `{}`, not in the scene's `{}`: give the body an attitude, or write axes = \"scene\"",
                    found.name, found.frame, self.frame
                )));
            }
        };
        let kind = ChannelKind::Vector;
        let parts = found.parts;
        Ok(BoundArrow {
            of: self.channels.intern(Channel { kind, parts }),
            body: axes == Axes::Body,
            length: arrow.length,
            heads: arrow.heads,
            label: if arrow.label.is_empty() {
                found.name
            } else {
                arrow.label.clone()
            },
            unit: found.unit,
            colour: arrow.colour.or(body.colour),
        })
    }
}

fn scaled(part: &ChannelElement, by: f64) -> ChannelElement {
    match part {
        ChannelElement::Fixed(x) => ChannelElement::Fixed(x * by),
        ChannelElement::Element {
            stream,
            field,
            index,
            scale,
        } => ChannelElement::Element {
            stream: *stream,
            field: field.clone(),
            index: *index,
            scale: scale * by,
        },
    }
}

fn unit(vector: [f64; 3]) -> [f64; 3] {
    let length = vector.iter().map(|x| x * x).sum::<f64>().sqrt();
    vector.map(|x| x / length)
}
