//! Generated scenario of FMUs: participants, connections between variables, and the decisions left to the user.

use std::collections::BTreeSet;
use std::fmt::Write;

use lockstep::units::convert;
use toml::Value;

use crate::description::{Causality, Description, Variable};
use crate::layout::{INPUTS, OUTPUTS, RECORDED, element};
use crate::names::{key, quoted};

/// Maximum length of a name in a scenario, letters.
const NAME_MAX: usize = 64;
/// Maximum number of outputs suggested for an input.
const SUGGESTED_MAX: usize = 3;

/// A participant.
#[derive(Debug, Clone)]
pub struct DraftParticipant<'a> {
    /// Its name; see [`Names`].
    pub name: String,
    /// The path of the FMU's file, relative to the scenario's folder.
    pub file: String,
    /// The FMU's description.
    pub about: &'a Description,
    /// The period as written in a scenario: `"10 ms"`.
    pub period: String,
    /// The first activation, where it is not 0.
    pub offset: Option<String>,
    /// Parameters and start values, by the names of the variables.
    pub parameters: Vec<(String, Value)>,
}

/// A variable that feeds another one. Parts are numbered as in [`Draft::parts`].
#[derive(Debug, Clone, PartialEq)]
pub struct VariableConnection {
    /// The part and variable of the source.
    pub from: (usize, String),
    /// The part and input of the destination.
    pub to: (usize, String),
    /// The factor, as in a connection's map.
    pub factor: Option<Value>,
    /// The offset, in the unit of the input's field.
    pub offset: Option<Value>,
}

/// A scenario before it is written as text.
#[derive(Debug, Clone, Default)]
pub struct Draft<'a> {
    /// Its title.
    pub title: String,
    /// Its duration: `"10 s"`.
    pub duration: String,
    /// The participants.
    pub parts: Vec<DraftParticipant<'a>>,
    /// The connections between variables.
    pub connections: Vec<VariableConnection>,
    /// Figures for the report: a title, and the part and variable shown.
    pub figures: Vec<(String, (usize, String))>,
    /// Lines for the end, each of which becomes a comment.
    pub notes: Vec<String>,
}

/// Unique names of participants or connections.
#[derive(Debug, Default)]
pub struct Names(BTreeSet<String>);

impl Names {
    /// Returns a unique name for a scenario that is as close to `wanted` as the rules for names allow.
    pub fn unique(&mut self, wanted: &str) -> String {
        let plain = |letter: char| letter.is_ascii_alphanumeric() || letter == '_' || letter == '-';
        let mut name: String = wanted.chars().map(|one| if plain(one) { one } else { '-' }).collect();
        name = name.trim_matches('-').to_owned();
        if !name.starts_with(|first: char| first.is_ascii_alphabetic()) || name == "orchestrator" {
            name.insert_str(0, "fmu-");
        }
        name.truncate(NAME_MAX);
        let mut picked = name.clone();
        for number in 2.. {
            if self.0.insert(picked.clone()) {
                break;
            }
            let tail = format!("-{number}");
            picked = format!("{}{tail}", &name[..name.len().min(NAME_MAX - tail.len())]);
        }
        picked
    }
}

fn literal(value: &Value) -> String {
    match value {
        Value::String(text) => quoted(text),
        Value::Array(all) => format!("[{}]", all.iter().map(literal).collect::<Vec<_>>().join(", ")),
        other => other.to_string(),
    }
}

fn list(names: &[&str]) -> String {
    let names: Vec<String> = names.iter().map(|name| quoted(name)).collect();
    format!("[{}]", names.join(", "))
}

/// The port of an output variable; variables that are not outputs are in the port of recorded variables.
fn port_of(about: &Description, variable: &str) -> &'static str {
    match about.variable(variable).map(|one| one.causality) {
        Some(Causality::Output) => OUTPUTS,
        _ => RECORDED,
    }
}

/// Whether a variable is a text or bytes, which are signals only where they are named.
fn is_content(about: &Description, variable: &Variable) -> bool {
    element(about.version, variable).is_some_and(|one| one.room().is_some())
}

/// The variables of one causality that are signals, larger elements first.
fn signals(about: &Description, causality: Causality) -> Vec<&Variable> {
    let own = about.variables.iter().filter(|one| one.causality == causality);
    let mut own: Vec<_> = own
        .filter_map(|one| Some((element(about.version, one)?.align(), one)))
        .collect();
    own.sort_by_key(|(size, _)| std::cmp::Reverse(*size));
    own.into_iter().map(|(_, one)| one).collect()
}

impl Draft<'_> {
    /// The scenario file.
    pub fn text(&self) -> String {
        let mut text = format!(
            "title = {}\nduration = {}\n",
            quoted(&self.title),
            quoted(&self.duration)
        );
        for number in 0..self.parts.len() {
            self.part(number, &mut text);
        }
        self.connections(&mut text);
        let drawn = |number: &usize, name: &str| {
            let about = self.parts[*number].about;
            about.variable(name).is_none_or(|one| !is_content(about, one))
        };
        let figures = (self.figures.iter()).filter(|(_, (part, variable))| drawn(part, variable));
        for (title, (part, variable)) in figures {
            let part = &self.parts[*part];
            let curve = format!("{}.{}.{variable}", part.name, port_of(part.about, variable));
            let _ = write!(
                text,
                "\n[[report.panels]]\ntitle = {}\ncurves = [{}]\n",
                quoted(title),
                quoted(&curve)
            );
        }
        if !self.notes.is_empty() {
            text.push('\n');
        }
        for line in self.notes.iter().flat_map(|note| note.lines()) {
            let _ = writeln!(text, "# {line}");
        }
        text
    }

    fn part(&self, number: usize, text: &mut String) {
        let part = &self.parts[number];
        let name = &part.name;
        let _ = writeln!(text, "\n[participants.{name}]\nperiod = {}", quoted(&part.period));
        if let Some(offset) = &part.offset {
            let _ = writeln!(text, "offset = {}", quoted(offset));
        }
        let _ = writeln!(text, "\n[participants.{name}.run]\nfmu = {}", quoted(&part.file));
        let all = signals(part.about, Causality::Input);
        let is_fed = |one: &&&Variable| {
            self.connections
                .iter()
                .any(|connection| connection.to.0 == number && connection.to.1 == one.name)
        };
        let fed: Vec<&str> = all.iter().filter(is_fed).map(|one| one.name.as_str()).collect();
        let sources = self.connections.iter().map(|connection| &connection.from);
        let sources = sources.chain(self.figures.iter().map(|(_, from)| from));
        let mut ports = Vec::new();
        if all.iter().any(|one| is_fed(&one) == is_content(part.about, one)) {
            if fed.len() < all.len() {
                text.push_str(match fed.is_empty() {
                    true => "# Nothing feeds it: its inputs keep their start values.\n",
                    false => "# All other inputs keep their start values.\n",
                });
            }
            ports.push(format!("inputs = {}", list(&fed)));
        }
        let outputs = signals(part.about, Causality::Output);
        let read = |one: &Variable| {
            let is_read = |(from, name): &&(usize, String)| *from == number && *name == one.name;
            sources.clone().any(|from| is_read(&from))
        };
        if outputs.iter().any(|one| is_content(part.about, one) && read(one)) {
            let named = outputs.iter().filter(|one| !is_content(part.about, one) || read(one));
            let named: Vec<&str> = named.map(|one| one.name.as_str()).collect();
            ports.push(format!("outputs = {}", list(&named)));
        }
        if !ports.is_empty() {
            let _ = writeln!(text, "ports = {{ {} }}", ports.join(", "));
        }
        let recorded: BTreeSet<&str> = sources
            .filter(|(part, _)| *part == number)
            .map(|(_, variable)| variable.as_str())
            .filter(|variable| port_of(part.about, variable) == RECORDED)
            .collect();
        if !recorded.is_empty() {
            let _ = writeln!(text, "record = {}", list(&recorded.into_iter().collect::<Vec<_>>()));
        }
        if !part.parameters.is_empty() {
            let _ = writeln!(text, "\n[participants.{name}.parameters]");
        }
        for (name, value) in &part.parameters {
            let _ = writeln!(text, "{} = {}", key(name), literal(value));
        }
    }

    /// One connection from each port to each port, with a map.
    fn connections(&self, text: &mut String) {
        let port = |connection: &VariableConnection| port_of(self.parts[connection.from.0].about, &connection.from.1);
        let mut pairs: Vec<(usize, &str, usize)> = Vec::new();
        for connection in &self.connections {
            let pair = (connection.from.0, port(connection), connection.to.0);
            if !pairs.contains(&pair) {
                pairs.push(pair);
            }
        }
        let mut names = Names::default();
        for (from, output, to) in pairs {
            let (sends, takes) = (&self.parts[from].name, &self.parts[to].name);
            let name = names.unique(&format!("{sends}-to-{takes}"));
            let _ = writeln!(
                text,
                "\n[connections.{name}]\nfrom = \"{sends}.{output}\"\nto = \"{takes}.{INPUTS}\"\n\n[connections.{name}.map]"
            );
            let own = |connection: &&VariableConnection| {
                (connection.from.0, port(connection), connection.to.0) == (from, output, to)
            };
            for connection in self.connections.iter().filter(own) {
                let source = quoted(&connection.from.1);
                let mut value = source.clone();
                if connection.factor.is_some() || connection.offset.is_some() {
                    value = format!("{{ from = {source}");
                    for (key, number) in [("factor", &connection.factor), ("offset", &connection.offset)] {
                        if let Some(number) = number {
                            let _ = write!(value, ", {key} = {}", literal(number));
                        }
                    }
                    value.push_str(" }");
                }
                let _ = writeln!(text, "{} = {value}", key(&connection.to.1));
            }
        }
    }
}

/// Whether `output` can feed `input` without conversion.
fn can_feed(sends: &Description, output: &Variable, takes: &Description, input: &Variable) -> bool {
    let types = element(sends.version, output).zip(element(takes.version, input));
    let unit = |about: &Description, one: &Variable| {
        let unit = about.unit(one).map(|unit| unit.of_port().unit);
        unit.unwrap_or_else(|| "1".to_owned())
    };
    let (from, to) = (unit(sends, output), unit(takes, input));
    let units = from == to || (input.kind.is_float() && convert(&format!("1 {from}"), &to).is_ok());
    units && output.extents == input.extents && types.is_some_and(|(from, to)| to.holds(from))
}

/// Connects FMUs that were not designed for each other: an input with the only output of the other FMUs that has its name,
/// and a matching type and unit. For every other input, a note lists the matching outputs.
pub fn connect_matching(draft: &mut Draft<'_>) {
    let parts = &draft.parts;
    let outputs = |taker: usize| {
        let others = parts.iter().enumerate().filter(move |(number, _)| *number != taker);
        others.flat_map(|(number, part)| {
            let own = signals(part.about, Causality::Output);
            own.into_iter().map(move |output| (number, output))
        })
    };
    for (number, part) in parts.iter().enumerate() {
        for input in signals(part.about, Causality::Input) {
            let fitting =
                outputs(number).filter(|(from, output)| can_feed(parts[*from].about, output, part.about, input));
            let (named, others): (Vec<_>, Vec<_>) =
                fitting.partition(|(_, output)| output.name.eq_ignore_ascii_case(&input.name));
            if let [(from, output)] = named[..] {
                draft.connections.push(VariableConnection {
                    from: (from, output.name.clone()),
                    to: (number, input.name.clone()),
                    factor: None,
                    offset: None,
                });
                continue;
            }
            let mut note = format!("`{}.{INPUTS}` has no source for {}", part.name, quoted(&input.name));
            let alike = others.into_iter().filter(|_| input.unit.is_some());
            let shown: Vec<_> = named.iter().copied().chain(alike).take(SUGGESTED_MAX).collect();
            if shown.is_empty() {
                note.push_str(": no output of another FMU has its name, or its unit.");
            } else {
                let _ = write!(
                    note,
                    ". To feed it, name it in `ports.{INPUTS}` above, and uncomment one of these:"
                );
            }
            for (choice, (from, output)) in shown.into_iter().enumerate() {
                let _ = write!(
                    note,
                    "\n  [connections.feed-{}-{choice}]\n  from = \"{}.{OUTPUTS}\"\n  to = \"{}.{INPUTS}\"\n  map = {{ {} = {} }}",
                    draft.notes.len() + 1,
                    parts[from].name,
                    part.name,
                    key(&input.name),
                    quoted(&output.name)
                );
            }
            draft.notes.push(note);
        }
    }
}
