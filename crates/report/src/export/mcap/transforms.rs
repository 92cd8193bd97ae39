//! Frame transforms from the poses among the fields and from a scene's bodies, and the solids attached to them.

use lockstep::port::Field;

use super::proto;
use crate::scene::{BoundBody, BoundScene, ChannelElement, Link, Model, Solid, SolidKind, write_elements};
use tape::StreamSpec;

/// A pose among the fields of a payload: frame `child` in frame `parent`.
struct Pose {
    parent: String,
    child: String,
    position: Field,
    attitude: Field,
}

/// The transforms that one stream provides.
pub(super) struct Poses {
    poses: Vec<Pose>,
    /// The indices of the bodies that move with this stream.
    bodies: Vec<usize>,
    next_s: f64,
}

/// The bodies of a scene, in the state after the records so far.
pub(super) struct SceneState {
    scene: BoundScene,
    /// The frame of the messages that a body is attached to, where its pose is one of theirs.
    frames: Vec<Option<String>>,
    numbers: Vec<Vec<f64>>,
}

/// Assigns transforms to streams. A frame has one source: when several streams have its pose, those that the bodies of the
/// scene follow come first, in the order of the bodies, then the others in the order of the streams.
pub(super) fn assign(streams: &[StreamSpec], scene: Option<&BoundScene>) -> (Vec<Option<Poses>>, Option<SceneState>) {
    let leads: Vec<usize> = scene.map_or_else(Vec::new, |scene| {
        scene.bodies().iter().map(|body| leading_stream(scene, body)).collect()
    });
    let mut order: Vec<usize> = (0..streams.len()).collect();
    order.sort_by_key(|at| leads.iter().position(|lead| lead == at).unwrap_or(usize::MAX));
    let mut poses: Vec<Vec<Pose>> = streams.iter().map(|_| Vec::new()).collect();
    let mut taken: Vec<String> = Vec::new();
    for at in order {
        let mut own = poses_of(&streams[at]);
        own.retain(|pose| !taken.contains(&pose.child) && pose.child != pose.parent);
        taken.extend(own.iter().map(|pose| pose.child.clone()));
        poses[at] = own;
    }
    let stage = scene.map(|scene| {
        let frame = |(body, lead): (&BoundBody, &usize)| {
            let pose = poses[*lead].iter().find(|pose| has_same_pose(scene, body, pose))?;
            Some(pose.child.clone())
        };
        SceneState {
            frames: scene.bodies().iter().zip(&leads).map(frame).collect(),
            numbers: scene
                .channels
                .list
                .iter()
                .map(|channel| channel.parts.iter().map(fixed).collect())
                .collect(),
            scene: scene.clone(),
        }
    });
    let all = poses.into_iter().enumerate().map(|(at, poses)| {
        let bodies: Vec<usize> = (0..leads.len()).filter(|body| leads[*body] == at).collect();
        (!poses.is_empty() || !bodies.is_empty()).then_some(Poses {
            poses,
            bodies,
            next_s: f64::NEG_INFINITY,
        })
    });
    (all.collect(), stage)
}

fn fixed(part: &ChannelElement) -> f64 {
    match part {
        ChannelElement::Fixed(x) => *x,
        ChannelElement::Element { .. } => f64::NAN,
    }
}

/// The stream whose records a body moves with.
fn leading_stream(scene: &BoundScene, body: &BoundBody) -> usize {
    let channels = [Some(body.position), body.attitude].into_iter().flatten();
    let mut parts = channels.flat_map(|at| &scene.channels.list[at].parts);
    let stream = parts.find_map(|part| match part {
        ChannelElement::Element { stream, .. } => Some(*stream),
        ChannelElement::Fixed(_) => None,
    });
    stream.unwrap_or(scene.lead)
}

/// Whether a body has exactly the pose of these fields.
fn has_same_pose(scene: &BoundScene, body: &BoundBody, pose: &Pose) -> bool {
    let is = |channel: usize, wanted: &Field| {
        let parts = &scene.channels.list[channel].parts;
        let same = |(at, part): (usize, &ChannelElement)| match part {
            ChannelElement::Element {
                field, index, scale, ..
            } => field == wanted && *index == at && *scale == 1.0,
            ChannelElement::Fixed(_) => false,
        };
        parts.len() == wanted.len() && parts.iter().enumerate().all(same)
    };
    is(body.position, &pose.position) && body.attitude.is_some_and(|attitude| is(attitude, &pose.attitude))
}

/// Pairs of fields `p_XY_X` and `quat_XY`, where X is one letter.
fn poses_of(spec: &StreamSpec) -> Vec<Pose> {
    let fields = &spec.descriptor.fields;
    fields
        .iter()
        .filter_map(|position| {
            let (frames, expressed) = position.name.strip_prefix("p_")?.rsplit_once('_')?;
            let child = frames.strip_prefix(expressed).filter(|child| !child.is_empty())?;
            let attitude = spec.descriptor.field(&format!("quat_{expressed}{child}"))?;
            (expressed.chars().count() == 1 && position.len() == 3 && attitude.len() == 4).then(|| Pose {
                parent: expressed.to_owned(),
                child: child.to_owned(),
                position: position.clone(),
                attitude: attitude.clone(),
            })
        })
        .collect()
}

impl Poses {
    /// Whether a transform is to be written at `stamp_s`, given at least `distance_s` between two.
    pub(super) fn is_due(&mut self, stamp_s: f64, distance_s: f64) -> bool {
        // Half a per mille of tolerance: rounding must not reject stamps at exactly the distance.
        if stamp_s < self.next_s - 5e-4 * distance_s {
            return false;
        }
        self.next_s = stamp_s + distance_s;
        true
    }

    /// A `FrameTransforms` message.
    pub(super) fn encode(&self, payload: &[u8], nanos: u64, stage: Option<&SceneState>, out: &mut Vec<u8>) {
        for pose in &self.poses {
            let p = std::array::from_fn(|i| pose.position.value(payload, i));
            let q: [f64; 4] = std::array::from_fn(|i| pose.attitude.value(payload, i));
            // Before its first activation a participant publishes zeros, which are no attitude: viewers refuse them.
            if q.iter().map(|x| x * x).sum::<f64>() < 0.5 {
                continue;
            }
            transform(out, nanos, &pose.parent, &pose.child, p, q);
        }
        let Some(stage) = stage else { return };
        for at in &self.bodies {
            stage.encode(*at, nanos, out);
        }
    }
}

impl SceneState {
    /// Applies a record of a stream to the bodies.
    pub(super) fn apply_record(&mut self, stream: usize, payload: &[u8]) {
        for (channel, numbers) in self.scene.channels.list.iter().zip(&mut self.numbers) {
            write_elements(channel, stream, payload, numbers);
        }
    }

    fn drawn_values<const N: usize>(&self, channel: usize) -> Option<[f64; N]> {
        let mut out = Vec::with_capacity(N);
        self.scene.channels.list[channel].drawn_values(&self.numbers[channel], |x| out.push(x));
        let numbers = <[f64; N]>::try_from(out).ok()?;
        numbers.iter().all(|x| x.is_finite()).then_some(numbers)
    }

    /// The pose of a body where the messages have no frame for it, and those of its links.
    fn encode(&self, at: usize, nanos: u64, out: &mut Vec<u8>) {
        let body = &self.scene.bodies()[at];
        let root = match &self.frames[at] {
            Some(frame) => frame,
            None => {
                let Some(p) = self.drawn_values::<3>(body.position) else {
                    return;
                };
                let q = body
                    .attitude
                    .map_or(Some([1.0, 0.0, 0.0, 0.0]), |attitude| self.drawn_values::<4>(attitude));
                let length = q.map_or(0.0, |q| q.iter().map(|x| x * x).sum::<f64>().sqrt());
                let Some(q) = q.filter(|_| length > 0.5) else { return };
                let world = if self.scene.frame.is_empty() {
                    "world"
                } else {
                    &self.scene.frame
                };
                // A body with the name of the world frame is that frame.
                if body.name != world {
                    transform(out, nanos, world, &body.name, p, q.map(|x| x / length));
                }
                &body.name
            }
        };
        for bound in &body.models {
            let values = bound.joints.map_or(&[][..], |joints| &self.numbers[joints]);
            let value = |link: &Link| link.joint.and_then(|joint| values.get(joint).copied()).unwrap_or(0.0);
            if values.iter().all(|x| x.is_finite()) {
                links(out, nanos, &bound.model, &body.name, root, value);
            }
        }
    }

    /// A `SceneUpdate` with one entity per link, attached to the link's frame, with unlimited lifetime.
    pub(super) fn solids(&self, nanos: u64) -> Vec<u8> {
        let mut out = Vec::new();
        for body in self.scene.bodies() {
            let links = body.models.iter().flat_map(|bound| &bound.model.links);
            for link in links.filter(|link| !link.shapes.is_empty()) {
                let name = format!("{}/{}", body.name, link.name);
                proto::message(&mut out, 2, |entity| {
                    timestamp(entity, 1, nanos);
                    proto::text(entity, 2, &name);
                    proto::text(entity, 3, &name);
                    proto::message(entity, 4, |_| {});
                    proto::integer(entity, 5, 1);
                    for shape in &link.shapes {
                        primitive(entity, shape);
                    }
                });
            }
        }
        out
    }
}

/// Links are named `<body>/<link>`: a link and a frame of the messages may have the same name.
fn links(out: &mut Vec<u8>, nanos: u64, model: &Model, prefix: &str, root: &str, value: impl Fn(&Link) -> f64) {
    for link in &model.links {
        let child = format!("{prefix}/{}", link.name);
        let Some(parent) = link.parent else {
            transform(out, nanos, root, &child, [0.0; 3], [1.0, 0.0, 0.0, 0.0]);
            continue;
        };
        let parent = format!("{prefix}/{}", model.links[parent].name);
        let fixed = from_rpy(link.rpy);
        let (mut p, mut q) = (link.xyz, fixed);
        if let Some(axis) = link.axis {
            let n = axis.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-12);
            let (value, u) = (value(link), axis.map(|x| x / n));
            if link.prismatic {
                let moved = rotate(fixed, u.map(|x| x * value));
                p = std::array::from_fn(|i| p[i] + moved[i]);
            } else {
                let (s, c) = (value / 2.0).sin_cos();
                q = quaternion_product(fixed, [c, s * u[0], s * u[1], s * u[2]]);
            }
        }
        transform(out, nanos, &parent, &child, p, q);
    }
}

fn quaternion_product(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

fn rotate(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let [_, x, y, z] = quaternion_product(
        quaternion_product(q, [0.0, v[0], v[1], v[2]]),
        [q[0], -q[1], -q[2], -q[3]],
    );
    [x, y, z]
}

/// Roll about x, then pitch about y, then yaw about z, all fixed axes, as URDF has it.
fn from_rpy([roll, pitch, yaw]: [f64; 3]) -> [f64; 4] {
    let half = |angle: f64| (angle / 2.0).sin_cos();
    let ((sr, cr), (sp, cp), (sy, cy)) = (half(roll), half(pitch), half(yaw));
    quaternion_product(
        quaternion_product([cy, 0.0, 0.0, sy], [cp, 0.0, sp, 0.0]),
        [cr, sr, 0.0, 0.0],
    )
}

fn timestamp(out: &mut Vec<u8>, number: u32, nanos: u64) {
    proto::message(out, number, |time| {
        proto::integer(time, 1, nanos / 1_000_000_000);
        proto::integer(time, 2, nanos % 1_000_000_000);
    });
}

fn vector(out: &mut Vec<u8>, number: u32, parts: &[f64]) {
    proto::message(out, number, |inner| {
        for (at, part) in parts.iter().enumerate() {
            proto::double(inner, at as u32 + 1, *part);
        }
    });
}

/// A quaternion, scalar first here and last there.
fn quaternion(out: &mut Vec<u8>, number: u32, [w, x, y, z]: [f64; 4]) {
    vector(out, number, &[x, y, z, w]);
}

fn transform(out: &mut Vec<u8>, nanos: u64, parent: &str, child: &str, p: [f64; 3], q: [f64; 4]) {
    proto::message(out, 1, |inner| {
        timestamp(inner, 1, nanos);
        proto::text(inner, 2, parent);
        proto::text(inner, 3, child);
        vector(inner, 4, &p);
        quaternion(inner, 5, q);
    });
}

fn primitive(out: &mut Vec<u8>, shape: &Solid) {
    let [a, b, c] = shape.size;
    let widest = a.max(b).max(f64::MIN_POSITIVE);
    let (number, size) = match shape.kind {
        SolidKind::Box => (8, [a, b, c]),
        SolidKind::Sphere => (9, [2.0 * a; 3]),
        SolidKind::Cylinder => (10, [2.0 * widest, 2.0 * widest, c]),
    };
    proto::message(out, number, |solid| {
        proto::message(solid, 1, |pose| {
            vector(pose, 1, &shape.xyz);
            quaternion(pose, 2, from_rpy(shape.rpy));
        });
        vector(solid, 2, &size);
        let cylinder = shape.kind == SolidKind::Cylinder;
        if cylinder {
            proto::double(solid, 3, a / widest);
            proto::double(solid, 4, b / widest);
        }
        vector(solid, if cylinder { 5 } else { 3 }, &shape.color());
    });
}
