//! Frame transforms from the poses among the fields, and the scene that hangs on them.

use lockstep::port::Field;

use super::proto;
use crate::geometry::{ARM_ANGLES, Body, Geometry, Kind, Model, SLOSH_ANGLES, Shape, TRUTH};
use tape::StreamSpec;

/// A pose among the fields of a payload: frame `child` in frame `parent`.
struct Pose {
    parent: String,
    child: String,
    position: Field,
    attitude: Field,
}

/// The transforms that one stream gives.
pub(super) struct Poses {
    poses: Vec<Pose>,
    /// The fields with the joint angles, when this stream moves the model.
    joints: Option<(Option<Field>, Option<Field>)>,
    target: bool,
    next_s: f64,
}

/// Which stream gives which transforms. A frame has one place: when several streams have its pose, the port `truth` is
/// believed first, `target` next, then the order of the streams.
pub(super) fn assign(streams: &[StreamSpec], geometry: Option<&Geometry>) -> Vec<Option<Poses>> {
    let mut order: Vec<usize> = (0..streams.len()).collect();
    order.sort_by_key(|at| match streams[*at].port.as_str() {
        TRUTH => 0,
        "target" => 1,
        _ => 2,
    });
    let mut out: Vec<Option<Poses>> = streams.iter().map(|_| None).collect();
    let mut taken: Vec<String> = Vec::new();
    for at in order {
        let spec = &streams[at];
        let mut poses = poses_of(spec);
        poses.retain(|pose| !taken.contains(&pose.child) && pose.child != pose.parent);
        taken.extend(poses.iter().map(|pose| pose.child.clone()));
        let has = |child: &str| poses.iter().any(|pose| pose.child == child);
        let angles = |names: &[&str]| names.iter().find_map(|name| spec.descriptor.field(name)).cloned();
        let joints = (has("B") && geometry.is_some_and(|g| g.servicer.is_some()))
            .then(|| (angles(ARM_ANGLES), angles(SLOSH_ANGLES)));
        if !poses.is_empty() {
            out[at] = Some(Poses {
                target: has("T"),
                poses,
                joints,
                next_s: f64::NEG_INFINITY,
            });
        }
    }
    out
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
    pub(super) fn due(&mut self, stamp_s: f64, distance_s: f64) -> bool {
        // Half a per mille of slack: stamps at exactly the distance must not fall behind by a rounding.
        if stamp_s < self.next_s - 5e-4 * distance_s {
            return false;
        }
        self.next_s = stamp_s + distance_s;
        true
    }

    /// A `FrameTransforms` message.
    pub(super) fn encode(&self, payload: &[u8], nanos: u64, geometry: Option<&Geometry>, out: &mut Vec<u8>) {
        for pose in &self.poses {
            let p = std::array::from_fn(|i| pose.position.value(payload, i));
            let q: [f64; 4] = std::array::from_fn(|i| pose.attitude.value(payload, i));
            // Before its first activation a participant publishes zeros, which are no attitude: viewers refuse them.
            if q.iter().map(|x| x * x).sum::<f64>() < 0.5 {
                continue;
            }
            transform(out, nanos, &pose.parent, &pose.child, p, q);
        }
        let Some(geometry) = geometry else { return };
        if let (Some((arm, slosh)), Some(model)) = (&self.joints, &geometry.servicer) {
            let angle = |body: &Body| match body.channel {
                Some(("q", i)) => arm.as_ref().map_or(0.0, |field| field.value(payload, i)),
                Some((_, i)) => slosh.as_ref().map_or(0.0, |field| field.value(payload, i)),
                None => 0.0,
            };
            links(out, nanos, model, "servicer", "B", angle);
        }
        if let (true, Some(model)) = (self.target, &geometry.target) {
            links(out, nanos, model, "target", "T", |_| 0.0);
        }
    }
}

/// Links are named `<prefix>/<link>`: a link and a frame of the messages may have the same name.
fn links(out: &mut Vec<u8>, nanos: u64, model: &Model, prefix: &str, root: &str, angle: impl Fn(&Body) -> f64) {
    for body in &model.bodies {
        let child = format!("{prefix}/{}", body.name);
        let Some(parent) = body.parent else {
            transform(out, nanos, root, &child, [0.0; 3], [1.0, 0.0, 0.0, 0.0]);
            continue;
        };
        let parent = format!("{prefix}/{}", model.bodies[parent].name);
        let fixed = from_rpy(body.rpy);
        let (mut p, mut q) = (body.xyz, fixed);
        if let Some(axis) = body.axis {
            let n = axis.iter().map(|x| x * x).sum::<f64>().sqrt().max(1e-12);
            let (value, u) = (angle(body), axis.map(|x| x / n));
            if body.prismatic {
                let moved = rotate(fixed, u.map(|x| x * value));
                p = std::array::from_fn(|i| p[i] + moved[i]);
            } else {
                let (s, c) = (value / 2.0).sin_cos();
                q = times(fixed, [c, s * u[0], s * u[1], s * u[2]]);
            }
        }
        transform(out, nanos, &parent, &child, p, q);
    }
}

fn times(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

fn rotate(q: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let [_, x, y, z] = times(times(q, [0.0, v[0], v[1], v[2]]), [q[0], -q[1], -q[2], -q[3]]);
    [x, y, z]
}

/// Roll about x, then pitch about y, then yaw about z, all fixed axes, as URDF has it.
fn from_rpy([roll, pitch, yaw]: [f64; 3]) -> [f64; 4] {
    let half = |angle: f64| (angle / 2.0).sin_cos();
    let ((sr, cr), (sp, cp), (sy, cy)) = (half(roll), half(pitch), half(yaw));
    times(times([cy, 0.0, 0.0, sy], [cp, 0.0, sp, 0.0]), [cr, sr, 0.0, 0.0])
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

/// A `SceneUpdate` with one entity per body, locked to the body's frame and there until the end.
pub(super) fn scene(geometry: &Geometry, nanos: u64) -> Vec<u8> {
    let mut out = Vec::new();
    for (prefix, model) in [("servicer", &geometry.servicer), ("target", &geometry.target)] {
        let bodies = model.iter().flat_map(|model| &model.bodies);
        for body in bodies.filter(|body| !body.shapes.is_empty()) {
            let name = format!("{prefix}/{}", body.name);
            proto::message(&mut out, 2, |entity| {
                timestamp(entity, 1, nanos);
                proto::text(entity, 2, &name);
                proto::text(entity, 3, &name);
                proto::message(entity, 4, |_| {});
                proto::integer(entity, 5, 1);
                for shape in &body.shapes {
                    primitive(entity, shape);
                }
            });
        }
    }
    out
}

fn primitive(out: &mut Vec<u8>, shape: &Shape) {
    let [a, b, c] = shape.size;
    let widest = a.max(b).max(f64::MIN_POSITIVE);
    let (number, size) = match shape.kind {
        Kind::Box => (8, [a, b, c]),
        Kind::Sphere => (9, [2.0 * a; 3]),
        Kind::Cylinder => (10, [2.0 * widest, 2.0 * widest, c]),
    };
    proto::message(out, number, |solid| {
        proto::message(solid, 1, |pose| {
            vector(pose, 1, &shape.xyz);
            quaternion(pose, 2, from_rpy(shape.rpy));
        });
        vector(solid, 2, &size);
        let cylinder = shape.kind == Kind::Cylinder;
        if cylinder {
            proto::double(solid, 3, a / widest);
            proto::double(solid, 4, b / widest);
        }
        vector(solid, if cylinder { 5 } else { 3 }, &shape.color());
    });
}
