//! The shapes of a body as a scenario writes them.

use toml::{Table, Value};

use super::keys::{Keys, at};
use super::model::{Model, Solid, SolidKind};
use super::types::{Arrow, Axes, Path, Shape};
use super::values::{boolean, colour, direction, positive, quantity, signal, vector3};
use crate::view::{Mistake, Signal};

/// The keys of each kind of shape, besides the key of the kind.
const KINDS: [(&str, &[&str]); 7] = [
    ("box", &["at", "turn", "colour"]),
    ("sphere", &["at", "turn", "colour"]),
    ("cylinder", &["at", "turn", "colour"]),
    ("arrow", &["along", "axes", "length", "heads", "label", "colour"]),
    ("path", &["dashed", "label", "colour"]),
    ("urdf", &["joints"]),
    ("frame", &[]),
];

/// The kind of a shape, given that all other keys belong to that kind.
fn kind_of(table: &Table) -> Result<&'static str, Mistake> {
    let listed = "box, sphere, cylinder, arrow, path, urdf, frame";
    let mut kinds = KINDS.iter().filter(|(kind, _)| table.contains_key(*kind));
    let (Some((kind, keys)), None) = (kinds.next(), kinds.next()) else {
        return Err(at("")(format!(
            "a shape has one of {listed}; several shapes are a list of tables"
        )));
    };
    let foreign = table.keys().find(|key| key != kind && !keys.contains(&key.as_str()));
    match foreign {
        None => Ok(kind),
        Some(key) if keys.is_empty() => Err(at(key)(format!("a `{kind}` has no other keys"))),
        Some(key) => Err(at(key)(format!(
            "a `{kind}` has no key `{key}`; it may have {}",
            keys.join(", ")
        ))),
    }
}

/// Reads one shape; `keys` are relative to it.
pub(super) fn shape(value: &Value) -> Result<Shape, Mistake> {
    let Value::Table(table) = value else {
        let reason =
            format!("`{value}` is not a shape: write a table such as {{ box = [\"10 cm\", \"10 cm\", \"20 cm\"] }}");
        return Err(at("")(reason));
    };
    let kind = kind_of(table)?;
    let keys = Keys::of(table, &table.keys().map(String::as_str).collect::<Vec<&str>>())?;
    match kind {
        "arrow" => arrow(&keys),
        "path" => path(&keys),
        "urdf" => urdf(table),
        "frame" => keys
            .value("frame", |value| positive(value, "m"))
            .map(|length| Shape::Frame(length.unwrap_or_default())),
        _ => solid(kind, table, &keys),
    }
}

fn solid(kind: &str, table: &Table, keys: &Keys<'_>) -> Result<Shape, Mistake> {
    let edges = |value: &Value| {
        let edges = vector3(value, "m")?;
        let whole = edges.iter().all(|x| *x > 0.0);
        whole
            .then_some(edges)
            .ok_or_else(|| format!("`{value}`: every edge of a box is above zero"))
    };
    let length = |value: &Value| positive(value, "m");
    let (kind, size) = match kind {
        "box" => (SolidKind::Box, keys.value("box", edges)?.unwrap_or_default()),
        "sphere" => (
            SolidKind::Sphere,
            [keys.value("sphere", length)?.unwrap_or_default(), 0.0, 0.0],
        ),
        _ => (
            SolidKind::Cylinder,
            cylinder(&table["cylinder"]).map_err(|wrong| wrong.with_prefix("cylinder"))?,
        ),
    };
    Ok(Shape::Solid(Solid {
        kind,
        size,
        xyz: keys.value("at", |value| vector3(value, "m"))?.unwrap_or_default(),
        rpy: keys.value("turn", |value| vector3(value, "rad"))?.unwrap_or_default(),
        rgba: keys.value("colour", colour)?.map(|[r, g, b]| [r, g, b, 1.0]),
        role: "visual",
    }))
}

/// Radius, radius at the +z end, length.
fn cylinder(value: &Value) -> Result<[f64; 3], Mistake> {
    let keys = Keys::of_value(value, &["radius", "top", "length"])?;
    let length = |key: &str| {
        let found = keys.value(key, |value| positive(value, "m"))?;
        found.ok_or_else(|| {
            at("")(format!(
                "`{key}` is missing: write {{ radius = \"5 cm\", length = \"20 cm\" }}"
            ))
        })
    };
    let (radius, length) = (length("radius")?, length("length")?);
    let top = |value: &Value| match quantity(value, "m")? {
        top if top >= 0.0 => Ok(top),
        top => Err(format!("{top} m is below zero: a cone ends at 0")),
    };
    Ok([radius, keys.value("top", top)?.unwrap_or(radius), length])
}

fn arrow(keys: &Keys<'_>) -> Result<Shape, Mistake> {
    let of = signal(keys.required_text("arrow")?).map_err(at("arrow"))?;
    let axes = match keys.text("axes")? {
        None => None,
        Some("scene") => Some(Axes::Scene),
        Some("body") => Some(Axes::Body),
        Some(other) => return Err(at("axes")(format!("`{other}`: write \"scene\" or \"body\""))),
    };
    let heads = |value: &Value| match value.as_integer() {
        Some(1) => Ok(1),
        Some(2) => Ok(2),
        _ => Err(format!("{value}: an arrow has 1 head, or 2 where it is a torque")),
    };
    Ok(Shape::Arrow(Arrow {
        of: vec![of],
        along: keys.value("along", direction)?,
        axes,
        length: keys.value("length", |value| positive(value, "m"))?,
        heads: keys.value("heads", heads)?.unwrap_or(1),
        label: keys.text("label")?.unwrap_or_default().to_owned(),
        colour: keys.value("colour", colour)?,
    }))
}

fn path(keys: &Keys<'_>) -> Result<Shape, Mistake> {
    let last = |value: &Value| match value {
        Value::Boolean(true) => Ok(None),
        Value::Boolean(false) => Err("write `path = true`, or a time such as \"10 s\"".to_owned()),
        time => positive(time, "s").map(Some),
    };
    Ok(Shape::Path(Path {
        last: keys.value("path", last)?.flatten(),
        label: keys.text("label")?.unwrap_or_default().to_owned(),
        colour: keys.value("colour", colour)?,
        dashed: keys.value("dashed", boolean)?.unwrap_or(false),
        width: 2.0,
        opacity: 1.0,
    }))
}

fn urdf(table: &Table) -> Result<Shape, Mistake> {
    let Some(text) = table.get("urdf").and_then(Value::as_str) else {
        return Err(at("urdf")("write { file = \"…\" } with the name of the file".into()));
    };
    let model = Model::read(text).map_err(|error| at("urdf")(error.to_string()))?;
    let names: Vec<&str> = match table.get("joints") {
        None => Vec::new(),
        Some(Value::String(text)) => vec![text],
        Some(Value::Array(items)) => items.iter().map(|item| item.as_str().unwrap_or_default()).collect(),
        Some(other) => return Err(at("joints")(format!("`{other}`: write a field, or a list of fields"))),
    };
    let joints = names.into_iter().map(|text| signal(text).map_err(at("joints")));
    Ok(Shape::Model {
        joints: joints.collect::<Result<Vec<Signal>, Mistake>>()?,
        model,
    })
}
