//! Files of gains: a specification with its robot, and output files.

use std::path::{Path, PathBuf};

use anyhow::{Context, anyhow, bail};
use capture::closed_loop::find_beside_specification;
use engine::check_title;
use serde_json::Value;
use synthesis::robot::{GainsFile, Robot, RobotError, Spec};

use crate::commands::model;
use crate::destination;

/// Reads a specification and the robot it names. The description's path is resolved relative to the working directory, the
/// folder of the specification, or its parent folder, whichever has it.
pub fn load(path: &Path, text: &str, allow_unphysical: bool) -> anyhow::Result<(Spec, Robot, String)> {
    let spec: Spec = toml::from_str(text)?;
    check_title(&spec.title).map_err(|reason| anyhow!("title: {reason}"))?;
    let Some(found) = find_beside_specification(path, &spec.robot.urdf) else {
        bail!(
            "robot.urdf = {:?}: no such file here, beside the specification, or above it",
            spec.robot.urdf
        )
    };
    let urdf = std::fs::read_to_string(&found).with_context(|| found.display().to_string())?;
    let robot = Robot::from_description(model::read(&found, allow_unphysical)?, &spec.robot)?;
    spec.check(robot.channels()).map_err(|error| at_line(text, &error))?;
    for doubt in robot.doubts(&spec) {
        eprintln!("warning: {}: {doubt}", path.display());
    }
    Ok((spec, robot, urdf))
}

/// The files that a specification names and that exist, with their keys.
pub fn files_of(path: &Path, spec: &Spec) -> Vec<(&'static str, PathBuf)> {
    let mut named = vec![("robot.urdf of SPEC", &spec.robot.urdf)];
    named.extend(spec.gains.ks.as_ref().map(|file| ("gains.ks of SPEC", file)));
    let closed_loop = spec.closed_loop.as_ref();
    named.extend(closed_loop.map(|runs| ("closed_loop.scenario of SPEC", &runs.scenario)));
    let found = named.into_iter();
    found
        .filter_map(|(key, file)| Some((key, find_beside_specification(path, file)?)))
        .collect()
}

/// The error with the line of its key in the file.
pub fn at_line(text: &str, error: &RobotError) -> anyhow::Error {
    let key = match error {
        RobotError::Length { what, .. } => what,
        RobotError::Value { what, .. } => what.as_str(),
        _ => "",
    };
    // Behind its words, and without an index or an explanation.
    let key = key.rsplit(' ').find(|word| word.contains('.')).unwrap_or_default();
    match line_of(text, key.split(['[', ':']).next().unwrap_or_default()) {
        Some(line) => anyhow!("line {line}: {error}"),
        None => anyhow!("{error}"),
    }
}

/// The line of `table.key` of a TOML file, if it stands below the header of its table.
fn line_of(text: &str, key: &str) -> Option<usize> {
    let (table, key) = key.rsplit_once('.')?;
    let header = format!("[{table}]");
    let lines = text.lines().map(str::trim).enumerate();
    let mut own = lines.skip_while(|(_, line)| !line.starts_with(&header)).skip(1);
    let own = own.by_ref().take_while(|(_, line)| !line.starts_with('['));
    let is_key = |line: &str| line.split_once('=').is_some_and(|(name, _)| name.trim() == key);
    own.into_iter()
        .find(|(_, line)| is_key(line))
        .map(|(index, _)| index + 1)
}

/// A file of gains as JSON: the gammas of the starts are numbers, and what is infinite is null.
pub fn json(file: &GainsFile) -> anyhow::Result<String> {
    let mut value = serde_json::to_value(file)?;
    if let Some(starts) = value.pointer_mut("/provenance/starts").and_then(Value::as_array_mut) {
        for start in starts {
            let gamma = start.as_str().and_then(|text| text.parse::<f64>().ok());
            *start = gamma.map_or(Value::Null, finite);
        }
    }
    without_infinity(&mut value);
    Ok(serde_json::to_string_pretty(&value)?)
}

/// A number, or null if it is infinite.
pub fn finite(number: f64) -> Value {
    // Files in TOML have the largest number for infinity.
    if number.abs() < f64::MAX {
        number.into()
    } else {
        Value::Null
    }
}

fn without_infinity(value: &mut Value) {
    match value {
        Value::Array(list) => list.iter_mut().for_each(without_infinity),
        Value::Object(table) => table.values_mut().for_each(without_infinity),
        Value::Number(number) if number.as_f64() == Some(f64::MAX) => *value = Value::Null,
        _ => {}
    }
}

/// Writes a file, and creates its folder.
pub fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    destination::write(path, text).with_context(|| path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn line_is_that_of_the_key_in_its_table() {
        let text = "[a]\nx = 1\n[[b]]\ny = 1\n[c] # x\n# y = 2\n  y = 3\ny_s = 4\n[c.d]\nx = 5\n";
        for (key, line) in [
            ("a.x", Some(2)),
            ("c.y", Some(7)),
            ("c.y_s", Some(8)),
            ("c.d.x", Some(10)),
            ("a.y", None),
            ("y", None),
        ] {
            assert_eq!(line_of(text, key), line, "{key}");
        }
        let at = |what: &'static str| {
            let error = RobotError::Length {
                what,
                found: 1,
                expected: 2,
            };
            at_line(text, &error).to_string()
        };
        assert!(at("c.y").starts_with("line 7: c.y has 1"), "{}", at("c.y"));
        assert!(at("a row of c.y").starts_with("line 7: "), "{}", at("a row of c.y"));
    }

    #[test]
    fn infinity_is_null_in_json() {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../gains/p-diagonal.toml");
        let mut file: GainsFile = toml::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
        file.channels[0].omega_rad_s = f64::MAX;
        file.provenance.starts = vec!["1.5".into(), "inf".into()];
        let value: Value = serde_json::from_str(&json(&file).unwrap()).unwrap();
        assert_eq!(value["channels"][0]["omega_rad_s"], Value::Null);
        assert!(value["channels"][1]["omega_rad_s"].is_number());
        assert_eq!(value["provenance"]["starts"], serde_json::json!([1.5, null]));
    }
}
