//! The instructions for an exported FMU: what it is, and how a scenario uses it.

use std::fmt::Write;
use std::path::Path;

use lockstep::port::Element;
use toml::Value;

use crate::describe::ModelInfo;
use crate::kind::Version;
use crate::model::Model;
use crate::unit;
use crate::variable::Port;

fn text(text: &str) -> String {
    Value::String(text.to_owned()).to_string()
}

/// One line that describes it.
pub fn summary(about: &ModelInfo, model: &Model) -> String {
    let version = if about.version == Version::Fmi3 { "3.0" } else { "2.0" };
    let state = if about.state {
        "saves its state"
    } else {
        "cannot save its state"
    };
    format!(
        "FMI {version} for co-simulation, {} variables, steps of {} s, {state}",
        model.variables.len(),
        about.period.seconds()
    )
}

/// The scenario entry in which the FMU replaces the participant `name`, port by port, with those `inputs` that are fed.
pub fn entry(name: &str, file: &Path, about: &ModelInfo, model: &Model, inputs: &[String]) -> String {
    let ports = model.body.ports();
    let inputs: Vec<&Port> = ports.inputs.iter().filter(|port| inputs.contains(&port.name)).collect();
    let full = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
    let mut out = format!(
        "In the place of the participant:\n\n[participants.{name}]\nperiod = {}\n",
        text(&model.period.to_string())
    );
    if model.start.is_positive() {
        let _ = writeln!(out, "offset = {}", text(&model.start.to_string()));
    }
    let _ = writeln!(
        out,
        "\n[participants.{name}.run]\nfmu = {}",
        text(&full.to_string_lossy())
    );
    if ports.feedthrough {
        out.push_str("feedthrough = true\n");
    }
    out.push_str("[participants.");
    let _ = writeln!(out, "{name}.run.messages]");
    for port in inputs.iter().copied().chain(&ports.outputs) {
        let _ = writeln!(out, "{} = {}", port.name, text(&port.descriptor.name));
    }
    let _ = writeln!(out, "[participants.{name}.run.ports]");
    if inputs.is_empty() {
        out.push_str("inputs = []\n");
    }
    for port in inputs.into_iter().chain(&ports.outputs) {
        let _ = writeln!(out, "{} = [{}]", port.name, fields(about.version, port).join(", "));
    }
    out
}

fn fields(version: Version, port: &Port) -> Vec<String> {
    let one = |field: &lockstep::port::Field| {
        let whole = format!("{}.{}", port.name, field.name);
        let variable = match (version, field.shape.as_slice()) {
            (Version::Fmi2, [_, ..]) => {
                let elements = (0..field.len()).map(|number| text(&format!("{whole}[{number}]")));
                format!("[{}]", elements.collect::<Vec<_>>().join(", "))
            }
            _ => text(&whole),
        };
        let mut entry = format!("{{ name = {}, variable = {variable}", text(&field.name));
        if unit::is_unit(&field.unit) {
            let _ = write!(entry, ", unit = {}", text(&field.unit));
        }
        if let Some(room) = field.element.room() {
            let _ = write!(entry, ", size = {room}");
        }
        // FMI 2.0 has one type for all integers.
        if version == Version::Fmi2
            && field.element.is_number()
            && field.element.range().is_some()
            && field.element != Element::I32
        {
            let _ = write!(entry, ", element = {}", text(field.element.name()));
        }
        if !field.frame.is_empty() {
            let _ = write!(entry, ", frame = {}", text(&field.frame));
        }
        entry + " }"
    };
    port.descriptor.fields.iter().map(one).collect()
}
