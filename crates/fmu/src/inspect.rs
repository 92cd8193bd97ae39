//! Inspection of an FMU before it runs, and a scenario entry for it. No code of the FMU is executed.

use std::collections::BTreeSet;
use std::fmt::Write;
use std::path::Path;

use toml::Value;

use crate::description::{Causality, Description, Type, Variable, Version};
use crate::layout::{Layout, element, may_lack_value};
use crate::model::{FmuError, Model};
use crate::options::Options;
use crate::settings::Settings;

/// The result of an inspection.
#[derive(Debug, Clone)]
pub struct Inspection {
    /// The report as text.
    pub text: String,
    /// A scenario with the FMU as its only participant.
    pub scenario: String,
    /// Whether it can run on this machine.
    pub usable: bool,
}

/// Inspects the FMU in `file`.
///
/// # Errors
/// When the file is not an FMU.
pub fn inspect(file: &Path) -> Result<Inspection, FmuError> {
    let model = Model::open(file)?;
    let about = &model.description;
    let mut text = String::new();
    let version = if about.version == Version::Fmi2 { "2.0" } else { "3.0" };
    let _ = writeln!(text, "{}: FMI {version}, co-simulation", about.model);
    for (words, value) in [("", &about.text), ("exported by ", &about.tool)] {
        if !value.is_empty() {
            let _ = writeln!(text, "  {words}{value}");
        }
    }
    let _ = writeln!(text, "  platforms: {}", model.platforms().join(", "));
    experiment(about, &mut text);
    describe_capabilities(&model, &mut text);
    let mut problems = about.problems.clone();
    let settings = Settings::read(about, &toml::Table::new());
    if let Ok(settings) = &settings {
        problems.extend(empty_arrays_note(about, settings));
    }
    let layout = settings.and_then(|settings| Layout::new(about, &Options::default(), &settings));
    match &layout {
        Ok(layout) => {
            for port in &layout.interface.inputs {
                ports(&model, "input", &port.name, &port.descriptor.fields, &mut text);
            }
            for port in &layout.interface.outputs {
                ports(&model, "output", &port.name, &port.descriptor.fields, &mut text);
            }
        }
        Err(error) => problems.push(error.reason.clone()),
    }
    problems.extend(layout.iter().flat_map(|layout| padding_name_notes(about, layout)));
    parameters(&model, &mut text);
    let library = model.library();
    if let Err(error) = &library {
        problems.push(error.to_string());
    }
    let texts = about.variables.iter().filter(|one| {
        let own = element(about.version, one);
        matches!(one.causality, Causality::Input | Causality::Output) && own.is_none_or(|own| own.room().is_some())
    });
    for one in texts {
        let kind = one.kind.name();
        problems.push(match element(about.version, one) {
            Some(element) => format!(
                "`{}` is a {kind}: it is a signal, {element}, where `ports` names it; {{ variable = \"{}\", size = BYTES }} gives it more \
                 room",
                one.name, one.name
            ),
            None => format!("`{}` is a {kind}, which is no signal", one.name),
        });
    }
    let figures: Vec<&str> = (about
        .variables
        .iter()
        .filter(|one| may_lack_value(about, one))
        .map(|one| one.name.as_str()))
    .collect();
    if !figures.is_empty() {
        problems.push(format!(
            "in no port unless `ports` names them, because they are NaN until they are known: {}",
            figures.join(", ")
        ));
    }
    for problem in &problems {
        let _ = writeln!(text, "note: {problem}");
    }
    Ok(Inspection {
        text,
        scenario: scenario(about, file),
        usable: library.is_ok() && layout.is_ok(),
    })
}

/// A note on the inputs and outputs that are arrays without elements.
fn empty_arrays_note(about: &Description, settings: &Settings) -> Option<String> {
    let signals = (about.variables.iter()).filter(|one| matches!(one.causality, Causality::Input | Causality::Output));
    let empty: Vec<&str> = signals
        .filter(|one| settings.is_empty(one))
        .map(|one| one.name.as_str())
        .collect();
    (!empty.is_empty()).then(|| {
        format!(
            "in no port, because they are arrays without elements; a structural parameter that is their size gives them some: {}",
            empty.join(", ")
        )
    })
}

/// Notes on variables whose fields look like padding: the layout gives its own padding a name that no variable has.
fn padding_name_notes(about: &Description, layout: &Layout) -> Vec<String> {
    let own = &layout.interface;
    let inputs = own.inputs.iter().map(|port| &port.descriptor);
    let all = inputs.chain(own.outputs.iter().map(|port| &port.descriptor));
    let fields = all.flat_map(|descriptor| &descriptor.fields);
    let named = fields.filter(|field| field.is_padding() && about.variable(&field.name).is_some());
    let note = |field: &lockstep::port::Field| {
        format!(
            "`{0}` is called like padding, which connections by name and exports leave out: give its field another name in `ports`, \
             {{ name = \"NAME\", variable = \"{0}\" }}",
            field.name
        )
    };
    named.map(note).collect()
}

/// Plans the ports of an FMU from its description alone; the resulting interface is valid, or the FMU is rejected.
pub fn check_description(description: &Description) {
    let planned = Settings::read(description, &toml::Table::new())
        .and_then(|settings| Layout::new(description, &Options::default(), &settings));
    if let Ok(layout) = planned {
        assert_eq!(layout.interface.validate(), Ok(()));
    }
}

/// The default experiment, and what a run cannot take over from it.
fn experiment(about: &Description, text: &mut String) {
    let own = &about.experiment;
    let times = [("from", own.start), ("to", own.stop), ("in steps of", own.step)];
    let given = times
        .iter()
        .filter_map(|(words, time)| Some(format!(" {words} {} s", (*time)?)));
    let given: String = given.collect();
    if !given.is_empty() {
        let _ = writeln!(text, "  default experiment:{given}");
    }
    if let Some(start) = own.start.filter(|start| *start < 0.0) {
        let _ = writeln!(
            text,
            "  a run starts at 0 s or later, and not at {start} s: the scenario below starts at 0 s"
        );
    }
}

fn describe_capabilities(model: &Model, text: &mut String) {
    let own = &model.description.capabilities;
    let state = match (own.state, own.serialise) {
        (true, true) => "its own functions save and restore it",
        _ => "it cannot save it: a checkpoint holds its inputs, which are played again",
    };
    let _ = writeln!(text, "  state: {state}");
    if let Some(step) = own.fixed_step {
        let _ = writeln!(
            text,
            "  its own step is fixed at {step} s: the period must be a whole multiple of it"
        );
    }
    if own.needs_execution_tool {
        text.push_str("  it needs the tool that exported it, installed on this machine\n");
    }
    if own.once_per_process {
        text.push_str("  a process may hold one instance only: --in-process takes one\n");
    }
    if own.event_mode {
        text.push_str("  its event mode and early return are not used: it handles its events within a step\n");
    }
}

fn ports(model: &Model, direction: &str, name: &str, fields: &[lockstep::port::Field], text: &mut String) {
    let _ = writeln!(text, "{direction} port `{name}`");
    for field in fields {
        let _ = write!(text, "  {field}");
        if let Some(variable) = model.description.variable(&field.name) {
            if !variable.items.is_empty() {
                let items: Vec<String> = variable
                    .items
                    .iter()
                    .map(|item| format!("{} {}", item.value, item.name))
                    .collect();
                let _ = write!(text, " ({})", items.join(", "));
            }
            if variable.feedthrough {
                text.push_str(", direct feedthrough");
            }
            if !variable.text.is_empty() {
                let _ = write!(text, " — {}", variable.text);
            }
            aliases_text(variable, text);
        }
        text.push('\n');
    }
}

/// The aliases of a variable.
fn aliases_text(variable: &Variable, text: &mut String) {
    for alias in &variable.aliases {
        let _ = write!(text, "; also `{}`", alias.name);
        if !alias.text.is_empty() {
            let _ = write!(text, " ({})", alias.text);
        }
    }
}

fn parameters(model: &Model, text: &mut String) {
    let about = &model.description;
    let mut title = "parameters and start values\n";
    for one in about.variables.iter().filter(|one| one.settable().is_ok()) {
        text.push_str(std::mem::take(&mut title));
        let _ = write!(text, "  {}: {} = {}", one.name, one.kind.name(), one.start.join(" "));
        let unit = one.unit.as_deref().unwrap_or_default();
        let _ = write!(text, "{}{unit}", if unit.is_empty() { "" } else { " " });
        let range = (one.range.min.as_deref(), one.range.max.as_deref());
        match range {
            (Some(min), Some(max)) => drop(write!(text, ", from {min} to {max}")),
            (Some(min), None) => drop(write!(text, ", at least {min}")),
            (None, Some(max)) => drop(write!(text, ", at most {max}")),
            (None, None) => {}
        }
        if !one.text.is_empty() {
            let _ = write!(text, " — {}", one.text);
        }
        aliases_text(one, text);
        text.push('\n');
    }
}

/// A suitable period for the FMU, s: the step of its default experiment, else 10 ms, rounded to a multiple of its own step
/// where that is fixed.
pub fn suggested_period(about: &Description) -> f64 {
    let wanted = about.experiment.step.unwrap_or(0.01);
    match about.capabilities.fixed_step {
        Some(own) => own * (wanted / own).round().max(1.0),
        None => wanted,
    }
}

/// The first instant and the end of a suitable run of the FMU, s: those of its default experiment, else 0 s and 10 s later. A run
/// does not start before 0 s; an experiment that does is moved there.
pub fn suggested_span(about: &Description) -> (f64, f64) {
    let start = about.experiment.start.unwrap_or(0.0);
    let first = start.max(0.0);
    match about.experiment.stop {
        Some(stop) if start < 0.0 => (first, stop - start),
        Some(stop) => (first, stop),
        None => (first, first + 10.0),
    }
}

fn scenario(about: &Description, file: &Path) -> String {
    let name: String = about
        .model
        .chars()
        .map(|letter| {
            if letter.is_ascii_alphanumeric() {
                letter.to_ascii_lowercase()
            } else {
                '-'
            }
        })
        .take(40)
        .collect();
    let name = if name.trim_matches('-').is_empty() {
        "fmu"
    } else {
        name.trim_matches('-')
    };
    let quoted = |text: &str| Value::String(text.to_owned()).to_string();
    // The duration is the end of the run.
    let (first, end) = suggested_span(about);
    let offset = if first > 0.0 {
        format!("offset = \"{first} s\"\n")
    } else {
        String::new()
    };
    let path = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
    let path = path.to_string_lossy();
    let mut text = format!(
        "title = {}\nduration = \"{end} s\"\n\n[participants.{name}]\nperiod = \"{} s\"\n{offset}run.fmu = {}\n",
        quoted(&about.model),
        suggested_period(about),
        quoted(&path)
    );
    let inputs = about
        .variables
        .iter()
        .filter(|one| one.causality == Causality::Input)
        .any(|one| element(about.version, one).is_some_and(|one| one.room().is_none()));
    if inputs {
        text.push_str("# Nothing feeds it: its inputs keep their start values. Without this line the port `inputs` must be connected.\nrun.ports.inputs = []\n");
    }
    let parameters = parameter_entries(about);
    if !parameters.is_empty() {
        let _ = writeln!(text, "\n[participants.{name}.parameters]");
    }
    for (key, value) in parameters {
        let _ = writeln!(text, "{} = {value}", Value::String(key));
    }
    text
}

/// The first parameters with their start values, as written in a scenario; of several that are one value, the first.
pub fn parameter_entries(about: &Description) -> Vec<(String, Value)> {
    let mut values = BTreeSet::new();
    let own = about
        .variables
        .iter()
        .filter(|one| one.causality == Causality::Parameter && one.settable().is_ok());
    own.filter(|one| values.insert(about.value_of(one)))
        .filter_map(|one| Some((one.name.clone(), start(about, one)?)))
        .take(20)
        .collect()
}

/// The start value of a scalar parameter.
fn start(about: &Description, one: &Variable) -> Option<Value> {
    let start = one.start.first().filter(|_| one.extents.is_empty())?;
    if !one.kind.holds(start) {
        return None;
    }
    Some(match one.kind {
        kind if kind.is_float() => {
            let number: f64 = start.parse().ok().filter(|number: &f64| number.is_finite())?;
            match about.unit(one) {
                Some(unit) if !unit.is_pure() => Value::String(format!("{number:?} {}", unit.name)),
                _ => Value::Float(number),
            }
        }
        Type::Boolean => Value::Boolean(start == "true" || start == "1"),
        Type::String | Type::Binary => Value::String(start.clone()),
        // TOML's integers are limited to below 2^63.
        _ => start
            .parse()
            .map_or_else(|_| Value::String(start.clone()), Value::Integer),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn described(more: &str, variables: &str) -> Description {
        let text = format!(
            "<fmiModelDescription fmiVersion='3.0' modelName='m' instantiationToken='t'><CoSimulation modelIdentifier='m'/>{more}\
             <ModelVariables>{variables}</ModelVariables><ModelStructure/></fmiModelDescription>"
        );
        Description::read(&text).expect("it is a description")
    }

    #[test]
    fn scenario_has_the_times_of_the_default_experiment() {
        let file = Path::new("/m.fmu");
        for (attributes, lines, expected) in [
            (
                "startTime='5' stopTime='8' stepSize='0.5'",
                &["duration = \"8 s\"", "offset = \"5 s\"", "period = \"0.5 s\""][..],
                "default experiment: from 5 s to 8 s in steps of 0.5 s",
            ),
            (
                "startTime='20'",
                &["duration = \"30 s\"", "offset = \"20 s\""],
                "from 20 s",
            ),
            (
                "startTime='-2' stopTime='3'",
                &["duration = \"5 s\""],
                "a run starts at 0 s or later, and not at -2 s",
            ),
            (
                "startTime='0' stopTime='3'",
                &["duration = \"3 s\"", "period = \"0.01 s\""],
                "from 0 s to 3 s",
            ),
        ] {
            let about = described(&format!("<DefaultExperiment {attributes}/>"), "");
            assert_eq!(about.problems, Vec::<String>::new());
            let text = scenario(&about, file);
            for line in lines {
                assert!(text.lines().any(|one| one == *line), "`{line}` is not in {text}");
            }
            assert_eq!(
                text.contains("offset"),
                lines[1..].iter().any(|line| line.contains("offset")),
                "{text}"
            );
            let mut shown = String::new();
            experiment(&about, &mut shown);
            assert!(shown.contains(expected), "{shown}");
        }
    }

    #[test]
    fn invalid_default_experiment_times_are_noted_and_unused() {
        for (attributes, note) in [
            ("stepSize='0'", "`stepSize` is 0 s, which is not positive"),
            ("stepSize='-0.1'", "`stepSize` is -0.1 s, which is not positive"),
            (
                "startTime='4' stopTime='4'",
                "`stopTime` is 4 s, which is not after the start at 4 s",
            ),
        ] {
            let about = described(&format!("<DefaultExperiment {attributes}/>"), "");
            assert_eq!(about.problems.len(), 1, "{:?}", about.problems);
            assert!(about.problems[0].contains(note), "{:?}", about.problems);
            assert_eq!((about.experiment.step, about.experiment.stop), (None, None));
            assert_eq!(suggested_period(&about), 0.01);
        }
    }

    #[test]
    fn variable_that_looks_like_padding_is_noted() {
        let about = described(
            "",
            "<Float64 name='x' valueReference='1' causality='output'/>\
             <UInt8 name='padding' valueReference='2' causality='output'/>\
             <UInt8 name='paddingCount' valueReference='3' causality='output'/>",
        );
        let layout = Layout::new(&about, &Options::default(), &Settings::default()).expect("it has ports");
        let notes = padding_name_notes(&about, &layout);
        assert_eq!(notes.len(), 1, "{notes:?}");
        assert!(notes[0].contains("`padding` is called like padding") && notes[0].contains("variable = \"padding\""));
    }
}
