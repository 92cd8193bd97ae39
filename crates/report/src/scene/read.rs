//! The table `[scene]` of a scenario.

use tape::StreamSpec;
use toml::{Table, Value};

use super::bind::bind;
use super::keys::{Keys, at};
use super::shape::shape;
use super::types::{Attitude, Body, Camera, Component, Distance, Position, Scene, Shape, Towards};
use super::values::{colour, direction, quantity, signal, vector3};
use crate::view::Mistake;

/// The default colours of bodies, in the order of their names.
const COLOURS: [[f64; 3]; 6] = [
    [0.25, 0.51, 0.84],
    [0.93, 0.52, 0.16],
    [0.27, 0.66, 0.38],
    [0.80, 0.28, 0.33],
    [0.56, 0.42, 0.78],
    [0.66, 0.68, 0.71],
];

impl Scene {
    /// Reads the table `[scene]`, checked as far as possible without the streams. Files are already replaced by their
    /// content.
    ///
    /// # Errors
    /// Every mistake, with its key below the table.
    pub fn read(table: &Table) -> Result<Scene, Vec<Mistake>> {
        let mut mistakes = Vec::new();
        let mut scene = Scene::default();
        let read = read_table(table, &mut scene, &mut mistakes);
        mistakes.extend(read.err());
        // Bodies with mistakes are missing, so references cannot be checked then.
        if mistakes.is_empty() {
            mistakes = scene.unknown_bodies();
        }
        if mistakes.is_empty() { Ok(scene) } else { Err(mistakes) }
    }

    /// The references to bodies that do not exist.
    fn unknown_bodies(&self) -> Vec<Mistake> {
        let names: Vec<String> = self.bodies.iter().map(|body| format!("`{}`", body.name)).collect();
        let mut mistakes = Vec::new();
        let mut look = |key: String, name: &str| {
            if !self.bodies.iter().any(|body| body.name == name) {
                let reason = format!("the scene has no body `{name}`; it has {}", names.join(", "));
                mistakes.push(Mistake::new(key, reason));
            }
        };
        let first = self.camera.iter().map(|camera| ("camera".to_owned(), camera));
        let others = self
            .cameras
            .iter()
            .map(|camera| (format!("cameras.{}", camera.name), camera));
        for (key, camera) in first.chain(others) {
            if let Some(on) = &camera.on {
                look(format!("{key}.on"), on);
            }
            if let Towards::Body(name) = &camera.towards {
                look(format!("{key}.towards"), name);
            }
        }
        for (number, one) in self.distances.iter().enumerate() {
            look(format!("distances.{}.from", number + 1), &one.from);
            look(format!("distances.{}.to", number + 1), &one.to);
        }
        mistakes
    }

    /// The parts of the scene that do not fit these streams. A body with a field of a participant that is not `certain` is
    /// left out.
    pub fn mismatches(&self, streams: &[StreamSpec], certain: &dyn Fn(&str) -> bool) -> Vec<Mistake> {
        if self.participants().all(|(_, name)| certain(name)) {
            return bind(self, streams).1;
        }
        let mut mistakes = Vec::new();
        for body in &self.bodies {
            let alone = Scene {
                frame: self.frame.clone(),
                bodies: vec![body.clone()],
                ..Scene::default()
            };
            if alone.participants().count() > 0 && alone.participants().all(|(_, name)| certain(name)) {
                mistakes.extend(bind(&alone, streams).1);
            }
        }
        mistakes
    }
}

/// Reads everything; a mistake in one body or camera does not hide those in others.
fn read_table(table: &Table, scene: &mut Scene, mistakes: &mut Vec<Mistake>) -> Result<(), Mistake> {
    let keys = Keys::of(table, &["frame", "up", "camera", "cameras", "bodies", "distances"])?;
    scene.frame = keys.text("frame")?.unwrap_or_default().to_owned();
    scene.up = keys.value("up", direction)?.unwrap_or_default();
    let Some(bodies) = keys.table("bodies")? else {
        return Err(at("")(
            "there is nothing to draw: write a table [scene.bodies.NAME]".to_owned(),
        ));
    };
    for (number, (name, value)) in bodies.iter().enumerate() {
        match body(name, value, COLOURS[number % COLOURS.len()]) {
            Ok(body) => scene.bodies.push(body),
            Err(wrong) => mistakes.push(wrong.with_prefix(&format!("bodies.{name}"))),
        }
    }
    if let Some(entry) = table.get("camera") {
        match camera("camera", entry) {
            Ok(camera) => scene.camera = Some(camera),
            Err(wrong) => mistakes.push(wrong.with_prefix("camera")),
        }
    }
    for (name, entry) in keys.table("cameras")?.into_iter().flatten() {
        match camera(name, entry) {
            Ok(camera) => scene.cameras.push(camera),
            Err(wrong) => mistakes.push(wrong.with_prefix(&format!("cameras.{name}"))),
        }
    }
    let distances = keys.list("distances")?.iter().enumerate();
    for (number, entry) in distances {
        let read = Keys::of_value(entry, &["from", "to", "label"]).and_then(|keys| distance(&keys));
        match read {
            Ok(distance) => scene.distances.push(distance),
            Err(wrong) => mistakes.push(wrong.with_prefix(&format!("distances.{}", number + 1))),
        }
    }
    Ok(())
}

fn distance(keys: &Keys<'_>) -> Result<Distance, Mistake> {
    let (from, to) = (keys.required_text("from")?, keys.required_text("to")?);
    Ok(Distance {
        label: keys
            .text("label")?
            .map_or_else(|| format!("{from} to {to}"), str::to_owned),
        from: from.to_owned(),
        to: to.to_owned(),
    })
}

fn camera(name: &str, entry: &Value) -> Result<Camera, Mistake> {
    let keys = Keys::of_value(entry, &["at", "towards", "up", "on"])?;
    let length = |value: &Value| vector3(value, "m");
    let (place, up, on) = (
        keys.value("at", length)?,
        keys.value("up", direction)?,
        keys.text("on")?,
    );
    let towards = match entry.get("towards") {
        None => Towards::Middle,
        Some(Value::String(name)) if !name.trim_start().starts_with('[') => Towards::Body(name.clone()),
        Some(_) => Towards::Point(keys.value("towards", length)?.unwrap_or_default()),
    };
    if on.is_some() {
        let (Towards::Point(to), Some([ux, uy, uz])) = (&towards, up) else {
            let reason =
                "it is carried by a body: write `towards` as a point and `up` as a direction in the body's axes";
            return Err(at("")(reason.into()));
        };
        let from = place.unwrap_or_default();
        let [x, y, z]: [f64; 3] = std::array::from_fn(|i| to[i] - from[i]);
        let across = [y * uz - z * uy, z * ux - x * uz, x * uy - y * ux];
        if across.iter().all(|x| x.abs() < 1e-9) {
            return Err(at("up")(
                "it points along the line of sight: choose one across it".into(),
            ));
        }
    } else if let (Some(from), Towards::Point(to)) = (place, &towards)
        && from == *to
    {
        return Err(at("at")(
            "the camera stands where it looks: move one of `at` and `towards`".into(),
        ));
    } else if let (Some([0.0, 0.0, 0.0]), Towards::Body(_)) = (place, &towards) {
        return Err(at("at")(
            "the camera stands where it looks: `at` is measured from the body".into(),
        ));
    }
    Ok(Camera {
        title: name.replace(['-', '_'], " "),
        name: name.to_owned(),
        at: place,
        towards,
        up,
        on: on.map(str::to_owned),
    })
}

fn body(name: &str, value: &Value, own: [f64; 3]) -> Result<Body, Mistake> {
    let keys = Keys::of_value(value, &["position", "attitude", "shape", "colour", "label"])?;
    let origin = || Position::Components([0; 3].map(|_| Component::Fixed(0.0)));
    let attitude = value.get("attitude").map(attitude).transpose();
    let shapes = match value.get("shape") {
        None => {
            return Err(at("")(
                "there is nothing to draw of it: write shape = { sphere = \"10 cm\" }".into(),
            ));
        }
        Some(Value::Array(items)) => {
            let shapes = items.iter().enumerate();
            let shapes =
                shapes.map(|(at, value)| shape(value).map_err(|wrong| wrong.with_prefix(&format!("shape.{}", at + 1))));
            shapes.collect::<Result<Vec<Shape>, Mistake>>()?
        }
        Some(one) => vec![shape(one).map_err(|wrong| wrong.with_prefix("shape"))?],
    };
    Ok(Body {
        label: Some(keys.text("label")?.unwrap_or(name).to_owned()).filter(|label| !label.is_empty()),
        name: name.to_owned(),
        position: keys.value("position", position)?.unwrap_or_else(origin),
        attitude: attitude.map_err(|wrong| wrong.with_prefix("attitude"))?,
        shapes,
        colour: Some(keys.value("colour", colour)?.unwrap_or(own)),
        once: false,
    })
}

fn position(value: &Value) -> Result<Position, String> {
    match value {
        Value::String(text) if text.trim_start().starts_with('[') => {
            vector3(value, "m").map(|place| Position::Components(place.map(Component::Fixed)))
        }
        Value::String(text) => signal(text).map(Position::Field),
        Value::Array(items) if items.len() == 3 => {
            let component = |item: &Value| match item {
                Value::String(text) if !text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) => {
                    signal(text).map(Component::Field)
                }
                other => quantity(other, "m").map(Component::Fixed),
            };
            let [x, y, z] = [component(&items[0])?, component(&items[1])?, component(&items[2])?];
            Ok(Position::Components([x, y, z]))
        }
        other => Err(format!(
            "`{other}` is not a position: write a field of three such as \"plant.motion.position\", or a list of x, y and z such as \
             [\"left.motion.position\", \"10 cm\", 0]"
        )),
    }
}

fn attitude(value: &Value) -> Result<Attitude, Mistake> {
    if let Value::String(text) = value {
        let of = signal(text).map_err(at(""))?;
        return Ok(Attitude::Quaternion { of, scalar_last: false });
    }
    let keys = Keys::of_value(value, &["quaternion", "order", "angle", "about"])?;
    let of = |key: &str| keys.text(key)?.map(|text| signal(text).map_err(at(key))).transpose();
    match (of("quaternion")?, of("angle")?, keys.value("about", direction)?, keys.text("order")?) {
        (Some(of), None, None, None | Some("wxyz")) => Ok(Attitude::Quaternion { of, scalar_last: false }),
        (Some(of), None, None, Some("xyzw")) => Ok(Attitude::Quaternion { of, scalar_last: true }),
        (Some(_), None, None, Some(other)) => Err(at("order")(format!(
            "`{other}` is not an order: write \"wxyz\" (scalar first, as messages here have it) or \"xyzw\""
        ))),
        (None, Some(of), Some(about), None) => Ok(Attitude::Angle { of, about }),
        _ => Err(at("")(
            "these do not go together: write a quaternion field, { quaternion = …, order = \"xyzw\" }, or { angle = …, about = [0, 0, 1] }"
                .into(),
        )),
    }
}
