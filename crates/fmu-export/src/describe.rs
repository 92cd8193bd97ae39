//! `modelDescription.xml`, for both versions of the standard.

use std::collections::BTreeSet;
use std::fmt::Write;

use lockstep::port::{Element, EnumValue};
use lockstep::time::Rational;

use crate::kind::{VariableKind, Version};
use crate::log::CATEGORIES;
use crate::parameter::{Parameter, ParameterValue};
use crate::unit;
use crate::variable::{Ports, ValueLocation, Variable};

/// The content of a model description apart from the variables.
pub struct ModelInfo<'a> {
    /// The version of the standard.
    pub version: Version,
    /// The name of the model and of its library.
    pub identifier: &'a str,
    /// The model's display name.
    pub model: &'a str,
    /// One line about it.
    pub description: &'a str,
    /// The generating tool.
    pub tool: &'a str,
    /// The token by which library and description are matched.
    pub token: &'a str,
    /// Whether the state can be saved.
    pub state: bool,
    /// Steps are whole multiples of this.
    pub period: Rational,
    /// The start of the experiment.
    pub start: Rational,
    /// The end of the experiment.
    pub stop: Option<Rational>,
}

/// Escapes text for an attribute.
fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\n' | '\r' | '\t' => {
                let _ = write!(out, "&#{};", letter as u32);
            }
            letter if letter.is_control() => out.push(' '),
            letter => out.push(letter),
        }
    }
    out
}

fn attribute(name: &str, value: &str) -> String {
    if value.is_empty() {
        String::new()
    } else {
        format!(" {name}=\"{}\"", quoted(value))
    }
}

/// The whole file.
pub fn describe(about: &ModelInfo, ports: &Ports, parameters: &[Parameter], variables: &[Variable]) -> String {
    let three = about.version == Version::Fmi3;
    let (token, number) = if three {
        ("instantiationToken", "3.0")
    } else {
        ("guid", "2.0")
    };
    let mut text = format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"{number}\" modelName=\"{}\" {token}=\"{}\"{} \
         generationTool=\"{}\" variableNamingConvention=\"flat\">\n",
        quoted(about.model),
        quoted(about.token),
        attribute("description", about.description),
        quoted(about.tool),
    );
    let state = if three { "FMUState" } else { "FMUstate" };
    let _ = write!(text, "  <CoSimulation modelIdentifier=\"{}\"", quoted(about.identifier));
    if about.state {
        let _ = write!(text, " canGetAndSet{state}=\"true\" canSerialize{state}=\"true\"");
    }
    if three {
        let _ = write!(
            text,
            " canHandleVariableCommunicationStepSize=\"true\" fixedInternalStepSize=\"{}\"",
            about.period.seconds()
        );
    }
    text.push_str("/>\n");
    units(&mut text, variables, parameters);
    let types = types(variables);
    definitions(&mut text, three, &types);
    text.push_str("  <LogCategories>\n");
    for name in CATEGORIES {
        let _ = writeln!(text, "    <Category name=\"{name}\"/>");
    }
    text.push_str("  </LogCategories>\n");
    let _ = write!(text, "  <DefaultExperiment startTime=\"{}\"", about.start.seconds());
    if let Some(stop) = about.stop {
        let _ = write!(text, " stopTime=\"{}\"", stop.seconds());
    }
    let _ = writeln!(text, " stepSize=\"{}\"/>", about.period.seconds());
    text.push_str("  <ModelVariables>\n");
    for (reference, variable) in variables.iter().enumerate() {
        if three {
            write_variable_fmi3(&mut text, reference, variable, ports, parameters, &types);
        } else {
            write_variable_fmi2(&mut text, reference, variable, ports, parameters, &types);
        }
    }
    text.push_str("  </ModelVariables>\n");
    structure(&mut text, three, variables, ports);
    text.push_str("</fmiModelDescription>\n");
    text
}

fn units(text: &mut String, variables: &[Variable], parameters: &[Parameter]) {
    let own = variables
        .iter()
        .filter(|one| one.kind.is_float())
        .map(|one| one.unit.as_str());
    let all: BTreeSet<&str> = own
        .chain(parameters.iter().map(|one| one.unit.as_str()))
        .filter(|one| unit::is_unit(one))
        .collect();
    if all.is_empty() {
        return;
    }
    text.push_str("  <UnitDefinitions>\n");
    for name in all {
        let Some(base) = unit::base(name) else {
            let _ = writeln!(text, "    <Unit name=\"{}\"/>", quoted(name));
            continue;
        };
        let _ = write!(text, "    <Unit name=\"{}\"><BaseUnit", quoted(name));
        for (symbol, power) in base.exponents.iter().filter(|(_, power)| *power != 0) {
            let _ = write!(text, " {symbol}=\"{power}\"");
        }
        if base.factor != 1.0 {
            let _ = write!(text, " factor=\"{:?}\"", base.factor);
        }
        text.push_str("/></Unit>\n");
    }
    text.push_str("  </UnitDefinitions>\n");
}

/// The enumerations, each once, in the order in which variables use them.
fn types(variables: &[Variable]) -> Vec<&[EnumValue]> {
    let mut all: Vec<&[EnumValue]> = Vec::new();
    for variable in variables.iter().filter(|one| one.kind == VariableKind::Enumeration) {
        if !all.contains(&&variable.items[..]) {
            all.push(&variable.items);
        }
    }
    all
}

/// The name of the type of a variable's enumeration.
fn type_name(variable: &Variable, types: &[&[EnumValue]]) -> String {
    let place = types.iter().position(|items| **items == variable.items[..]);
    match place.filter(|_| variable.kind == VariableKind::Enumeration) {
        Some(place) => format!(" declaredType=\"Enumeration{}\"", place + 1),
        None => String::new(),
    }
}

fn definitions(text: &mut String, three: bool, types: &[&[EnumValue]]) {
    if types.is_empty() {
        return;
    }
    text.push_str("  <TypeDefinitions>\n");
    for (place, items) in types.iter().enumerate() {
        let (open, close) = if three {
            (
                format!("<EnumerationType name=\"Enumeration{}\">", place + 1),
                "</EnumerationType>",
            )
        } else {
            let open = format!("<SimpleType name=\"Enumeration{}\"><Enumeration>", place + 1);
            (open, "</Enumeration></SimpleType>")
        };
        let _ = write!(text, "    {open}");
        for item in *items {
            let _ = write!(text, "<Item name=\"{}\" value=\"{}\"/>", quoted(&item.name), item.value);
        }
        let _ = writeln!(text, "{close}");
    }
    text.push_str("  </TypeDefinitions>\n");
}

/// Causality, variability and `initial`.
fn causality_and_variability(variable: &Variable, ports: &Ports) -> (&'static str, &'static str, Option<&'static str>) {
    let changing = if variable.kind.is_float() && !ports.discrete {
        "continuous"
    } else {
        "discrete"
    };
    match variable.place {
        ValueLocation::Time => ("independent", "continuous", None),
        ValueLocation::Parameter(_) => ("parameter", "fixed", Some("exact")),
        ValueLocation::Input(..) => ("input", changing, None),
        ValueLocation::Output(..) => ("output", changing, Some("calculated")),
        ValueLocation::Figure(_) => ("output", "discrete", Some("calculated")),
    }
}

/// The start values of a variable that has any, as a list in an attribute; a text is returned unchanged.
fn start(variable: &Variable, parameters: &[Parameter]) -> Option<String> {
    let zeros;
    let bytes: &[u8] = match variable.place {
        ValueLocation::Input(..) => {
            zeros = vec![0; variable.len * variable.kind.size()];
            &zeros
        }
        ValueLocation::Parameter(number) => match &parameters[number].value {
            ParameterValue::Text(text) => return Some(text.clone()),
            ParameterValue::Bytes(bytes) => {
                let from = variable.first * variable.kind.size();
                &bytes[from..from + variable.len * variable.kind.size()]
            }
        },
        ValueLocation::Time | ValueLocation::Output(..) | ValueLocation::Figure(_) => return None,
    };
    let one = |bytes: &[u8]| match variable.kind {
        VariableKind::Number(Element::F64) => format!("{:?}", Element::F64.to_f64(bytes)),
        VariableKind::Number(Element::F32) => format!("{:?}", Element::F32.to_f64(bytes) as f32),
        VariableKind::Number(element) => element.to_integer(bytes).to_string(),
        VariableKind::Enumeration => bytes[0].to_string(),
        VariableKind::Boolean => (bytes[0] != 0).to_string(),
        // An input is initially empty.
        VariableKind::Text | VariableKind::Content(_) => String::new(),
    };
    let all: Vec<String> = bytes.chunks_exact(variable.kind.size()).map(one).collect();
    Some(all.join(" "))
}

fn unit_of(variable: &Variable) -> String {
    if variable.kind.is_float() && unit::is_unit(&variable.unit) {
        attribute("unit", &variable.unit)
    } else {
        String::new()
    }
}

fn write_variable_fmi2(
    text: &mut String,
    reference: usize,
    variable: &Variable,
    ports: &Ports,
    parameters: &[Parameter],
    types: &[&[EnumValue]],
) {
    let (causality, variability, initial) = causality_and_variability(variable, ports);
    let _ = writeln!(
        text,
        "    <ScalarVariable name=\"{}\" valueReference=\"{reference}\"{} causality=\"{causality}\" variability=\"{variability}\"{}>",
        quoted(&variable.name),
        attribute("description", &variable.description),
        attribute("initial", initial.unwrap_or_default()),
    );
    let start = start(variable, parameters).map_or_else(String::new, |start| format!(" start=\"{}\"", quoted(&start)));
    let kind = variable.kind.name(Version::Fmi2);
    let _ = writeln!(
        text,
        "      <{kind}{}{}{start}/>\n    </ScalarVariable>",
        type_name(variable, types),
        unit_of(variable)
    );
}

fn write_variable_fmi3(
    text: &mut String,
    reference: usize,
    variable: &Variable,
    ports: &Ports,
    parameters: &[Parameter],
    types: &[&[EnumValue]],
) {
    let (causality, variability, initial) = causality_and_variability(variable, ports);
    let kind = variable.kind.name(Version::Fmi3);
    let start = start(variable, parameters);
    let content = matches!(variable.kind, VariableKind::Text | VariableKind::Content(_));
    let written = start.as_ref().filter(|_| !content);
    let _ = write!(
        text,
        "    <{kind} name=\"{}\" valueReference=\"{reference}\"{} causality=\"{causality}\" variability=\"{variability}\"{}{}{}{}",
        quoted(&variable.name),
        attribute("description", &variable.description),
        attribute("initial", initial.unwrap_or_default()),
        type_name(variable, types),
        unit_of(variable),
        written.map_or_else(String::new, |start| attribute("start", start)),
    );
    if let VariableKind::Content(Element::Bytes(room)) = variable.kind {
        let _ = write!(text, " maxSize=\"{room}\"");
    }
    let mut inside = String::new();
    for extent in &variable.extents {
        let _ = write!(inside, "<Dimension start=\"{extent}\"/>");
    }
    if let (true, Some(start)) = (content, &start) {
        let one = format!("<Start value=\"{}\"/>", quoted(start.trim()));
        inside += &one.repeat(variable.len);
    }
    if inside.is_empty() {
        text.push_str("/>\n");
    } else {
        let _ = writeln!(text, ">{inside}</{kind}>");
    }
}

fn structure(text: &mut String, three: bool, variables: &[Variable], ports: &Ports) {
    let outputs: Vec<usize> = (variables.iter().enumerate())
        .filter(|(_, one)| matches!(one.place, ValueLocation::Output(..) | ValueLocation::Figure(_)))
        .map(|(number, _)| number)
        .collect();
    let inputs: Vec<String> = (variables.iter().enumerate())
        .filter(|(_, one)| matches!(one.place, ValueLocation::Input(..)))
        .map(|(number, _)| (if three { number } else { number + 1 }).to_string())
        .collect();
    let inputs = if ports.feedthrough {
        inputs.join(" ")
    } else {
        String::new()
    };
    let none = String::new();
    text.push_str("  <ModelStructure>\n");
    let line = |text: &mut String, tag: &str, number: usize| {
        let inputs = if matches!(variables[number].place, ValueLocation::Output(..)) {
            &inputs
        } else {
            &none
        };
        let which = if three {
            format!("valueReference=\"{number}\"")
        } else {
            format!("index=\"{}\"", number + 1)
        };
        let _ = writeln!(text, "    <{tag} {which} dependencies=\"{inputs}\"/>");
    };
    if three {
        outputs.iter().for_each(|number| line(text, "Output", *number));
        outputs.iter().for_each(|number| line(text, "InitialUnknown", *number));
    } else if !outputs.is_empty() {
        for (around, tag) in [("Outputs", "Unknown"), ("InitialUnknowns", "Unknown")] {
            let _ = writeln!(text, "    <{around}>");
            outputs.iter().for_each(|number| line(text, tag, *number));
            let _ = writeln!(text, "    </{around}>");
        }
    }
    text.push_str("  </ModelStructure>\n");
}
