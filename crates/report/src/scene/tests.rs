//! Tests: drawn values against the tape; scenes that do not fit.

use lockstep::port::{Descriptor, Element, Field};
use lockstep::time::Rational;
use proptest::prelude::*;
use tape::{MemoryTape, Sink, StreamSpec};
use toml::Table;

use super::{Scene, bind};
use crate::view::Mistake;

/// A stream of doubles: names, counts, units, frames.
fn stream(
    participant: &str,
    port: &str,
    fields: &[(&str, u32, &str, &str)],
    period: Rational,
    offset: Rational,
) -> StreamSpec {
    let mut size = 0;
    let placed = fields.iter().map(|(name, count, unit, frame)| {
        let field = Field {
            name: (*name).into(),
            element: Element::F64,
            shape: if *count == 1 { Vec::new() } else { vec![*count] },
            unit: (*unit).into(),
            frame: (*frame).into(),
            offset: size,
            values: Vec::new(),
        };
        size += 8 * count;
        field
    });
    let fields = placed.collect();
    let descriptor = Descriptor {
        name: "S".into(),
        size,
        fields,
    };
    StreamSpec::new(participant, port, descriptor, offset, period)
}

fn streams() -> Vec<StreamSpec> {
    let fast = [
        ("place", 3, "cm", "hall"),
        ("turned", 4, "1", "hall"),
        ("tilt", 1, "deg", "hall"),
        ("pull", 3, "kN", "box"),
        ("speed", 3, "m/s", "hall"),
    ];
    let slow = [
        ("rail", 1, "mm", ""),
        ("sway", 2, "deg", ""),
        ("elsewhere", 3, "m", "dock"),
    ];
    vec![
        stream("mover", "now", &fast, Rational::from_millis(10), Rational::ZERO),
        stream(
            "lift",
            "now",
            &slow,
            Rational::from_millis(25),
            Rational::from_millis(40),
        ),
    ]
}

const URDF: &str = r#"<robot name="r"><link name="a"/><link name="b"/><link name="c"/>
  <joint name="s" type="prismatic"><parent link="a"/><child link="b"/></joint>
  <joint name="t" type="revolute"><parent link="b"/><child link="c"/></joint></robot>"#;

fn scene(text: &str) -> Result<Scene, Vec<Mistake>> {
    Scene::read(&text.replace("URDF", &format!("'''{URDF}'''")).parse::<Table>().unwrap())
}

fn mistakes_in(text: &str) -> Vec<String> {
    let wrong = match scene(text) {
        Ok(scene) => scene.mismatches(&streams(), &|_| true),
        Err(wrong) => wrong,
    };
    wrong
        .into_iter()
        .map(|one| format!("{}: {}", one.key, one.reason))
        .collect()
}

const ALL: &str = r##"
    up = [0, 0, 1]
    camera = { at = ["2 m", 2, "150 cm"], towards = [0, 0, 0] }
    distances = [{ from = "crate", to = "wall" }]
    [cameras.ride]
    on = "crate"
    towards = "[1, 0, 0] m"
    up = [0, 0, 1]
    [bodies.crate]
    position = "mover.now.place"
    attitude = { quaternion = "mover.now.turned", order = "xyzw" }
    shape = [{ box = ["10 cm", "10 cm", "20 cm"] }, { arrow = "mover.now.pull" }, { path = "2 s" }]
    colour = "#3366cc"
    [bodies.flap]
    position = [0, "lift.now.rail", "20 cm"]
    attitude = { angle = "mover.now.tilt", about = [0, 2, 0] }
    shape = { sphere = "5 cm" }
    [bodies.robot]
    shape = { urdf = URDF, joints = ["lift.now.rail", "lift.now.sway[1]"] }
    [bodies.wall]
    position = "[100, 0, 0] cm"
    shape = { frame = "30 cm" }
"##;

#[test]
fn scene_reader_accepts_every_kind_of_body() {
    assert_eq!(mistakes_in(ALL), [""; 0]);
    let (bound, _) = bind(&scene(ALL).unwrap(), &streams());
    let bound = bound.unwrap();
    let names: Vec<&str> = bound.bodies().iter().map(|body| &*body.name).collect();
    assert_eq!(names, ["crate", "flap", "robot", "wall"]);
    assert_eq!((bound.lead, &*bound.frame), (0, "hall"), "the faster stream leads");
}

/// A tape with these numbers in sequence.
fn tape(numbers: &[f64], samples: [u64; 2]) -> MemoryTape {
    let specs = streams();
    let mut tape = MemoryTape::new(specs.clone()).unwrap();
    let mut numbers = numbers.iter().cycle();
    for (stream, spec) in specs.iter().enumerate() {
        for index in 0..samples[stream] {
            let payload: Vec<u8> = (0..spec.descriptor.size / 8)
                .flat_map(|_| numbers.next().unwrap().to_le_bytes())
                .collect();
            let [offset, period] = [[0, 10], [40, 25]][stream];
            let stamp = (offset + index * period) as f64 / 1000.0;
            tape.sample(stream, index, stamp, &payload).unwrap();
        }
    }
    tape
}

/// The newest sample of `field` at or before an instant in milliseconds, and its offset in the payload.
fn newest(numbers: &[f64], samples: [u64; 2], stream: usize, at_ms: u64, element: usize) -> Option<f64> {
    let (period, offset, width) = [(10, 0, 14), (25, 40, 6)][stream];
    let index = (at_ms.checked_sub(offset)? / period).min(samples[stream] - 1);
    let before = if stream == 0 { 0 } else { samples[0] * 14 };
    Some(numbers[((before + index * width) as usize + element) % numbers.len()])
}

proptest! {
    /// Poses, joints and arrows at every instant are the tape's values, converted and in drawing order; nothing is drawn of
    /// a stream before its first sample.
    #[test]
    fn drawn_values_equal_tape_values(
        numbers in prop::collection::vec(-3.0_f64..3.0, 31..97),
        fast in 1_u64..30,
        slow in 1_u64..12,
    ) {
        let samples = [fast, slow];
        let tape = tape(&numbers, samples);
        let (bound, _) = bind(&scene(ALL).unwrap(), &streams());
        let bound = bound.unwrap();
        let picks: Vec<u64> = (0..fast).collect();
        let motion = bound.channels.at(&tape, bound.lead, &picks).unwrap();
        let data = serde_json::to_value(&bound).unwrap();
        let place = |body: usize, key: &str| data["bodies"][body][key].as_u64().unwrap() as usize;
        for pick in 0..fast {
            let ms = 10 * pick;
            prop_assert_eq!(motion.t[pick as usize], ms as f64 / 1000.0);
            let of = |stream, element| newest(&numbers, samples, stream, ms, element).unwrap_or(f64::NAN);
            let tilt = of(0, 7).to_radians() / 2.0;
            let expected = [
                (place(0, "position"), vec![of(0, 0) / 100.0, of(0, 1) / 100.0, of(0, 2) / 100.0]),
                (place(0, "attitude"), vec![of(0, 6), of(0, 3), of(0, 4), of(0, 5)]),
                (data["bodies"][0]["arrows"][0]["of"].as_u64().unwrap() as usize, vec![of(0, 8), of(0, 9), of(0, 10)]),
                (place(1, "position"), vec![0.0, of(1, 0) / 1000.0, 0.2]),
                (place(1, "attitude"), vec![tilt.cos(), 0.0, tilt.sin(), 0.0]),
                (data["bodies"][2]["models"][0]["joints"].as_u64().unwrap() as usize, vec![of(1, 0) / 1000.0, of(1, 2).to_radians()]),
                (place(3, "position"), vec![1.0, 0.0, 0.0]),
            ];
            for (channel, expected) in expected {
                let width = expected.len();
                let drawn = &motion.values[channel].numbers[pick as usize * width..][..width];
                for (drawn, expected) in drawn.iter().zip(expected) {
                    let same = (f64::from(*drawn) - expected).abs() < 1e-6 || (drawn.is_nan() && expected.is_nan());
                    prop_assert!(same, "channel {} at {} ms: {} against {}", channel, ms, drawn, expected);
                }
            }
        }
    }
}

/// A body, further keys, and the mistake; `@` is replaced by a position.
const BODIES: &[(&str, &str)] = &[
    (
        "position = 'mover.now.spot'\nshape = { sphere = 1 }",
        "bodies.b.position: `mover.now` has no field or element `spot`; it has",
    ),
    (
        "position = 'mover.now.tilt'\nshape = { sphere = 1 }",
        "bodies.b.position: `mover.now.tilt` has one element, and a position",
    ),
    (
        "position = 'mover.now.speed'\nshape = { sphere = 1 }",
        "bodies.b.position: `mover.now.speed` is in `m/s`, and a position",
    ),
    (
        "position = ['mover.now.place', 0, 0]\nshape = { sphere = 1 }",
        "bodies.b.position: `mover.now.place` has 3 elements, and a component",
    ),
    (
        "position = 3\nshape = { sphere = 1 }",
        "bodies.b.position: `3` is not a position: write a field of three",
    ),
    (
        "position = 'place'\nshape = { sphere = 1 }",
        "bodies.b.position: `place` is not a signal: write PARTICIPANT.OUTPUT.FIELD",
    ),
    (
        "@attitude = 'mover.now.place'\nshape = { sphere = 1 }",
        "bodies.b.attitude: `mover.now.place` has 3 elements, and a quaternion needs 4",
    ),
    (
        "@attitude = { quaternion = 'mover.now.turned', order = 'zyx' }\nshape = { sphere = 1 }",
        "bodies.b.attitude.order: `zyx` is not an order: write \"wxyz\"",
    ),
    (
        "@attitude = { angle = 'mover.now.tilt' }\nshape = { sphere = 1 }",
        "bodies.b.attitude: these do not go together",
    ),
    (
        "@attitude = { angle = 'lift.now.rail', about = [0, 0, 1] }\nshape = { sphere = 1 }",
        "bodies.b.attitude: `lift.now.rail` is in `mm`, and an angle needs a unit such as `rad`",
    ),
    (
        "@shape = { arrow = 'mover.now.pull' }",
        "bodies.b.shape.arrow: `mover.now.pull` is in frame `box`, not in the scene's `hall`: give the body an attitude",
    ),
    (
        "@shape = { arrow = 'mover.now.tilt' }",
        "bodies.b.shape.arrow: `mover.now.tilt` has one element, and an arrow without `along` needs 3",
    ),
    (
        "@shape = { arrow = 'mover.now.speed', axes = 'body' }",
        "bodies.b.shape.arrow: the body has no attitude",
    ),
    (
        "@shape = { arrow = 'mover.now.speed', heads = 3 }",
        "bodies.b.shape.heads: 3: an arrow has 1 head, or 2",
    ),
    (
        "@shape = { urdf = URDF, joints = 'lift.now.rail' }",
        "bodies.b.shape.joints: the fields have 1 elements, and the model has 2 moving joints",
    ),
    (
        "@shape = { urdf = URDF, joints = ['lift.now.sway[0]', 'lift.now.rail'] }",
        "bodies.b.shape.joints: `lift.now.sway[0]` is in `deg`, and joint 1 of the model needs a unit such as `m`",
    ),
    ("@shape = { urdf = 'no' }", "bodies.b.shape.urdf: the model is not XML"),
    (
        "@shape = { box = [1, 2, 0] }",
        "bodies.b.shape.box: `[1, 2, 0]`: every edge of a box is above zero",
    ),
    ("@shape = { box = ['1 kg', 2, 3] }", "bodies.b.shape.box: `1 kg`"),
    (
        "@shape = { cylinder = { radius = 1 } }",
        "bodies.b.shape.cylinder: `length` is missing",
    ),
    (
        "@shape = { sphere = '5 cm', joints = 'a.b.c' }",
        "bodies.b.shape.joints: a `sphere` has no key `joints`; it may have at, turn, colour",
    ),
    (
        "@shape = [{ sphere = 1 }, { cone = 2 }]",
        "bodies.b.shape.2: a shape has one of box, sphere",
    ),
    (
        "@shape = 'box'",
        "bodies.b.shape: `\"box\"` is not a shape: write a table",
    ),
    (
        "@shape = { sphere = 1 }\ncolour = 'red'",
        "bodies.b.colour: `red` is not a colour: write red, green and blue",
    ),
    (
        "@shape = { sphere = 1 }\nmass = 3",
        "bodies.b.mass: there is no such key; there is position, attitude, shape",
    ),
    ("@colour = '#ffffff'", "bodies.b: there is nothing to draw of it"),
    ("shape = { sphere = 1 }", "bodies: nothing in the scene follows a field"),
];

/// Further keys besides a valid body `b`, and the mistake.
const AROUND: &[(&str, &str)] = &[
    (
        "camera = { towards = 'c' }",
        "camera.towards: the scene has no body `c`; it has `b`",
    ),
    (
        "camera = { at = [0, 0, 1], towards = [0, 0, 1] }",
        "camera.at: the camera stands where it looks",
    ),
    (
        "camera = { on = 'b', towards = [0, 0, 1], up = [0, 0, 1] }",
        "camera.up: it points along the line of sight",
    ),
    (
        "cameras = { far = { on = 'b', towards = [0, 0, 1] } }",
        "cameras.far: it is carried by a body: write `towards` as a point and `up`",
    ),
    ("up = [0, 0, 0]", "up: `[0, 0, 0]` is not a direction"),
    (
        "distances = [{ from = 'b', to = 'd' }]",
        "distances.1.to: the scene has no body `d`",
    ),
    ("distances = [{ from = 'b' }]", "distances.1: `to` is missing"),
    (
        "frame = 'dock'",
        "bodies.b.position: `mover.now.place` is in frame `hall`, and the scene is drawn in `dock`",
    ),
    ("colour = 3", "colour: there is no such key; there is frame, up, camera"),
];

fn refused_as(text: &str, expected: &str) {
    let wrong = mistakes_in(text);
    assert_eq!(wrong.len(), 1, "{text}: {wrong:?}");
    assert!(wrong[0].starts_with(expected), "{text}: {}", wrong[0]);
}

#[test]
fn scene_mistakes_name_key_and_remedy() {
    const PLACE: &str = "position = 'mover.now.place'\n";
    for (body, expected) in BODIES {
        refused_as(&format!("[bodies.b]\n{}", body.replace('@', PLACE)), expected);
    }
    for (around, expected) in AROUND {
        refused_as(
            &format!("{around}\n[bodies.b]\n{PLACE}shape = {{ sphere = 1 }}"),
            expected,
        );
    }
    refused_as(
        "up = [0, 0, 1]",
        ": there is nothing to draw: write a table [scene.bodies.NAME]",
    );
    let other = "[bodies.c]\nposition = 'lift.now.elsewhere'\nshape = { sphere = 1 }";
    let both = format!("[bodies.b]\n{PLACE}shape = {{ sphere = 1 }}\n{other}");
    let expected =
        "bodies.c.position: `lift.now.elsewhere` is in frame `dock`, and the scene is drawn in `hall`: take a field";
    refused_as(&both, expected);
}

#[test]
fn scene_field_of_unknown_participant_is_not_rejected() {
    let text = "[bodies.a]\nposition = 'mover.now.spot'\nshape = { sphere = 1 }\n[bodies.b]\nposition = 'lift.now.spot'\nshape = { sphere = 1 }";
    let wrong = scene(text).unwrap().mismatches(&streams(), &|name| name == "lift");
    assert_eq!(wrong.len(), 1, "{wrong:?}");
    assert_eq!(wrong[0].key, "bodies.b.position");
}
