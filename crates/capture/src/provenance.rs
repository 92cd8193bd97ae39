//! Checks of robot descriptions against the models, and of gains against the robot they were tuned for.

use multibody::{Description, UrdfOptions, UrdfReading};
use toml::{Table, Value};

use engine::scenario::Scenario;

/// Digest of a text, to notice a change: 64-bit FNV-1a.
pub fn digest(text: &str) -> String {
    format!("fnv1a64:{:016x}", lockstep::fnv::fnv1a(text))
}

/// Digest of the physics of a robot description: masses, inertias, joints, frames and limits, not its appearance. `None`
/// when the text is not a description.
pub fn plant_digest(urdf: &str) -> Option<String> {
    let reading = read(urdf)?;
    Some(format!("physics:{:016x}", reading.description.digest()))
}

/// Reads a description, physical or not.
fn read(urdf: &str) -> Option<UrdfReading> {
    Description::read_urdf(urdf, UrdfOptions { allow_unphysical: true }).ok()
}

/// Warnings about a scenario: the parts of its robot descriptions that the models ignore, and mismatches between the gains
/// of its controllers and their provenance. None of them prevents a run: a changed robot may well work with its old gains,
/// but the properties of the gains were proved for another robot.
pub fn warnings(scenario: &Scenario) -> Vec<String> {
    let mut out = Vec::new();
    let mut seen = Vec::new();
    for entry in &scenario.participants {
        let Some(urdf) = text(&entry.setup.parameters, "urdf").filter(|urdf| !seen.contains(urdf)) else {
            continue;
        };
        seen.push(urdf);
        let warnings = read(urdf).map(|reading| reading.warnings).unwrap_or_default();
        let key = format!("participants.{}.parameters.urdf", entry.setup.name);
        out.extend(warnings.iter().map(|warning| format!("{key}: {warning}")));
    }
    for entry in &scenario.participants {
        let parameters = &entry.setup.parameters;
        let key = format!("participants.{}.parameters.gains", entry.setup.name);
        let Some(provenance) = table(parameters, "gains").and_then(|gains| table(gains, "provenance")) else {
            continue;
        };
        let specification = text(provenance, "specification").unwrap_or("their specification");
        if let (Some(then), Some(urdf)) = (text(provenance, "plant_digest"), text(parameters, "urdf"))
            && let Some(now) = plant_digest(urdf)
            && then != now
        {
            out.push(format!(
                "{key}: these gains were tuned for another robot ({then}, here {now}): their margins are not those of this \
                 robot; tune again with `escapement tune {specification}`"
            ));
        }
        let (then, now) = (
            provenance.get("controller_period_s").and_then(Value::as_float),
            entry.setup.period,
        );
        if let Some(then) = then.filter(|then| (then - now).abs() > 1e-9 * then) {
            out.push(format!(
                "{key}: these gains were tuned for a period of {then} s, and the controller's is {now} s: their margins are not those of \
                 this loop; tune again with sampling.controller_period_s = {now} in {specification}"
            ));
        }
    }
    out
}

fn table<'a>(table: &'a Table, key: &str) -> Option<&'a Table> {
    table.get(key).and_then(Value::as_table)
}

fn text<'a>(table: &'a Table, key: &str) -> Option<&'a str> {
    table.get(key).and_then(Value::as_str)
}
