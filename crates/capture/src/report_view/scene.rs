//! The capture's playback: servicer with its tank, target, tool and grasp point, forces and paths.

use report::scene::{
    Arrow, Attitude, Axes, Body, Camera, Component, Distance, Model, Path, Position, Scene, Shape, Solid, SolidKind,
    Towards,
};
use report::view::Signal;
use tape::StreamSpec;
use toml::{Table, Value};

use super::table::{ARM_ANGLES, FORCE, Names, SLOSH_ANGLES, TORQUE};
use super::target;

/// The port with the complete state of motion.
const TRUTH: &str = "truth";

const TOOL_PATH: [f64; 3] = [0.16, 0.62, 0.98];
const COMMANDED_PATH: [f64; 3] = [0.98, 0.72, 0.22];
const BASE_PATH: [f64; 3] = [0.55, 0.60, 0.68];
const FORCE_COLOUR: [f64; 3] = [0.98, 0.62, 0.16];
const TORQUE_COLOUR: [f64; 3] = [0.74, 0.42, 0.96];

/// The scene of a run that has the position of the base, and the errors of those models in its plan that cannot be drawn.
pub(super) fn scene(streams: &[StreamSpec], plan: &Table) -> (Option<Scene>, Vec<String>) {
    let mut notes = Vec::new();
    let has = |port: &str, name: &str| {
        streams
            .iter()
            .any(|spec| spec.port == port && spec.descriptor.field(name).is_some())
    };
    if !has(TRUTH, "p_NB_N") {
        return (None, notes);
    }
    let (mut articulated_model, mut rigid_model) = (None, None);
    for text in models(plan) {
        match Model::read(text) {
            Ok(model) if model.moving() > 0 => drop(articulated_model.get_or_insert(model)),
            Ok(model) => drop(rigid_model.get_or_insert(model)),
            Err(error) => notes.push(error.to_string()),
        }
    }
    let mut bodies = vec![fixed_body("N", 0.3), base(articulated_model, streams)];
    let port = if has(TRUTH, "p_NT_N") { TRUTH } else { "target" };
    if has(port, "p_NT_N") {
        let mut body = body_at_pose(
            "target",
            "T",
            port,
            "p_NT_N",
            Some("quat_NT").filter(|name| has(port, name)),
            0.75,
        );
        body.once = true;
        match rigid_model {
            Some(model) => body.shapes.push(Shape::Model {
                model,
                joints: Vec::new(),
            }),
            None => body.shapes.extend(target::solids(plan).into_iter().map(Shape::Solid)),
        }
        bodies.push(body);
    }
    for (name, attitude, label) in [("p_NE_N", "quat_NE", "E"), ("p_NG_N", "quat_NG", "G")] {
        if has(TRUTH, name) {
            bodies.push(body_at_pose(
                label,
                label,
                TRUTH,
                name,
                Some(attitude).filter(|name| has(TRUTH, name)),
                0.18,
            ));
        }
    }
    if let Some(tool) = bodies.iter_mut().find(|body| body.name == "E") {
        tool.shapes.push(path("path of the tool", TOOL_PATH, 3.0));
    }
    if has("setpoint", "p_ND_N") {
        let mut commanded = body_at_pose("D", "", "setpoint", "p_ND_N", None, 0.0);
        let Shape::Path(path) = path("commanded", COMMANDED_PATH, 2.0) else {
            unreachable!("a path is one")
        };
        commanded.shapes = vec![Shape::Path(Path { dashed: true, ..path })];
        bodies.push(commanded);
    }
    let scene = Scene {
        frame: "N".into(),
        // The approach of the stock scenarios is along z, from left to right; x is upwards.
        up: [1.0, 0.0, 0.0],
        camera: None,
        cameras: cameras(),
        bodies,
        distances: vec![Distance {
            label: "tool to grasp point".into(),
            from: "E".into(),
            to: "G".into(),
        }],
    };
    (Some(scene), notes)
}

/// Every text of a plan that is a URDF.
fn models(plan: &Table) -> Vec<&str> {
    fn collect_models<'a>(value: &'a Value, found: &mut Vec<&'a str>) {
        match value {
            Value::String(text) if text.contains("<robot") => found.push(text),
            Value::Array(items) => items.iter().for_each(|item| collect_models(item, found)),
            Value::Table(table) => table.values().for_each(|item| collect_models(item, found)),
            _ => {}
        }
    }
    let mut found = Vec::new();
    plan.values().for_each(|value| collect_models(value, &mut found));
    found
}

fn cameras() -> Vec<Camera> {
    let towards = |name: &str, title: &str, body: &str, at| Camera {
        name: name.into(),
        title: title.into(),
        at: Some(at),
        towards: Towards::Body(body.into()),
        up: None,
        on: None,
    };
    vec![
        towards("approach", "Approach", "target", [2.81, 3.23, -5.03]),
        towards("grasp", "Grasp point", "G", [0.327, 1.191, -0.851]),
        Camera {
            name: "tool".into(),
            title: "Tool camera".into(),
            at: Some([0.16, 0.0, -0.42]),
            towards: Towards::Point([0.0, 0.0, 0.7]),
            up: Some([1.0, 0.0, 0.0]),
            on: Some("E".into()),
        },
    ]
}

fn fixed_body(name: &str, axes: f64) -> Body {
    Body {
        name: name.into(),
        label: Some(name.into()),
        position: Position::Components([0; 3].map(|_| Component::Fixed(0.0))),
        attitude: None,
        shapes: vec![Shape::Frame(axes)],
        colour: None,
        once: false,
    }
}

/// A body whose pose has these field names, with its axes.
fn body_at_pose(name: &str, label: &str, port: &str, position: &str, attitude: Option<&str>, axes: f64) -> Body {
    Body {
        name: name.into(),
        label: Some(label.to_owned()).filter(|label| !label.is_empty()),
        position: Position::Field(Signal::at(port, &[position])),
        attitude: attitude.map(|attitude| Attitude::Quaternion {
            of: Signal::at(port, &[attitude]),
            scalar_last: false,
        }),
        // Without an attitude, the axes would be those of the world.
        shapes: attitude.map(|_| Shape::Frame(axes)).into_iter().collect(),
        colour: None,
        once: false,
    }
}

fn path(label: &str, colour: [f64; 3], width: f64) -> Shape {
    Shape::Path(Path {
        label: label.into(),
        colour: Some(colour),
        dashed: false,
        width,
        opacity: 1.0,
        last: None,
    })
}

/// The servicer: its model where the plan has one, the loads on its base, its path.
fn base(model: Option<Model>, streams: &[StreamSpec]) -> Body {
    let attitude = streams
        .iter()
        .any(|spec| spec.port == TRUTH && spec.descriptor.field("quat_NB").is_some());
    let mut body = body_at_pose("servicer", "B", TRUTH, "p_NB_N", attitude.then_some("quat_NB"), 0.75);
    body.shapes.push(match model {
        Some(model) => Shape::Model {
            joints: joints(&model, streams),
            model,
        },
        None => Shape::Solid(Solid {
            kind: SolidKind::Box,
            size: [1.0; 3],
            xyz: [0.0; 3],
            rpy: [0.0; 3],
            rgba: None,
            role: "bus",
        }),
    });
    let Shape::Path(path) = path("", BASE_PATH, 2.0) else {
        unreachable!("a path is one")
    };
    body.shapes.push(Shape::Path(Path { opacity: 0.55, ..path }));
    // Applied loads are drawn; the command only where no stream has the applied loads.
    for (names, label, heads, colour) in [
        (FORCE, "base force", 1, FORCE_COLOUR),
        (TORQUE, "base torque", 2, TORQUE_COLOUR),
    ] {
        let of = [Signal::at(TRUTH, names), Signal::at("command", names)];
        let has_field = |signal: &Signal| {
            let named = |spec: &&StreamSpec| spec.port == signal.port;
            streams
                .iter()
                .filter(named)
                .any(|spec| names.iter().any(|name| spec.descriptor.field(name).is_some()))
        };
        if of.iter().any(has_field) {
            body.shapes.push(Shape::Arrow(Arrow {
                of: of.into(),
                along: None,
                axes: Some(if attitude { Axes::Body } else { Axes::Scene }),
                length: Some(0.9),
                heads,
                label: label.into(),
                colour: Some(colour),
            }));
        }
    }
    body
}

/// The angles of the arm and of the pendulum, as many as the model has joints; none where there are fewer.
fn joints(model: &Model, streams: &[StreamSpec]) -> Vec<Signal> {
    let length = |names: Names| {
        let truth = streams.iter().filter(|spec| spec.port == TRUTH);
        let mut fields = truth.filter_map(|spec| names.iter().find_map(|name| spec.descriptor.field(name)));
        fields.next().map_or(0, lockstep::port::Field::len)
    };
    let mut remaining = model.moving();
    let mut signals = Vec::new();
    for names in [ARM_ANGLES, SLOSH_ANGLES] {
        let taken = length(names).min(remaining);
        if taken > 0 {
            signals.push(Signal::at(TRUTH, names).part(0, taken));
        }
        remaining -= taken;
    }
    if remaining > 0 {
        signals.clear();
    }
    signals
}
