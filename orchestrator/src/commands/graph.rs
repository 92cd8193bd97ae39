//! `escapement graph SCENARIO`: a drawing of the connections between participants, with rates and delays.

use std::collections::HashMap;

use crate::catalogue::catalogue;
use clap::Args;
use lockstep::fault::FaultPort;
use lockstep::participant::Kind;
use lockstep::plan::{Link, Plan};

use crate::arguments::{ScenarioArgs, StartArgs};
use engine::run::faults::notices;
use engine::run::{CheckedScenario, RunFailure};
use engine::scenario::Scenario;

/// Arguments of `graph`.
#[derive(Debug, Args)]
pub struct GraphArgs {
    /// The scenario
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// The programs to query
    #[command(flatten)]
    pub start: StartArgs,
    /// The language of the drawing
    #[arg(long, value_enum, default_value_t)]
    pub format: GraphFormat,
}

/// A drawing's language.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum GraphFormat {
    /// Mermaid, for Markdown pages
    #[default]
    Mermaid,
    /// DOT, for Graphviz
    Dot,
}

/// Prints the drawing.
pub fn run(args: &GraphArgs) -> anyhow::Result<i32> {
    let read = Scenario::changed(catalogue(), &args.scenario.scenario, &args.scenario.changes());
    let known = read.map_err(RunFailure::from);
    match known.and_then(|scenario| args.start.check(&scenario)) {
        Ok(known) => {
            print!("{}", draw(&known, args.format));
            let unknown = known.unknown();
            if !unknown.is_empty() {
                let unknown = unknown.join(", ");
                eprintln!("note: not asked: {unknown}. Kind and order are unknown: --start asks");
            }
            Ok(0)
        }
        Err(error) => {
            eprintln!("error: {error}");
            Ok(error.exit_code())
        }
    }
}

fn draw(known: &CheckedScenario, format: GraphFormat) -> String {
    match format {
        GraphFormat::Mermaid => mermaid(known),
        GraphFormat::Dot => dot(known),
    }
}

/// The text below a participant's name: its order only where that of all is known.
fn timing_text(known: &CheckedScenario, all_known: bool, number: usize) -> String {
    let own = &known.plan.participants[number];
    let order = match (all_known, &known.interfaces[number]) {
        (true, _) => format!(", order {}", own.rank + 1),
        (false, Some(_)) => String::new(),
        (false, None) => ", kind unknown".to_owned(),
    };
    format!("every {}{order}", own.period)
}

fn label(link: &Link, plan: &Plan) -> String {
    let port = &plan.participants[link.from.0].interface.outputs[link.from.1].name;
    let mut label = port.clone();
    let taken = &plan.participants[link.to.0].interface.inputs[link.to.1].descriptor;
    let fields = link.conversion.as_ref().map(|conversion| conversion.targets(taken));
    if let Some(fields) = fields.filter(|fields| !fields.is_empty()) {
        label += &format!(" to {}", fields.join(", "));
    }
    if link.timing.delay.is_positive() {
        label += &format!(", {} late", link.timing.delay);
    }
    if link.timing.jitter.is_positive() {
        label += &format!(" + up to {}", link.timing.jitter);
    }
    if link.timing.drop > 0.0 {
        label += &format!(", {} % lost", 100.0 * link.timing.drop);
    }
    label
}

/// A line for each fault of a plan, and the outputs and inputs that the faults affect.
struct Faults<'a> {
    /// By output or input.
    signals: HashMap<FaultPort, Vec<&'a str>>,
    /// By name, in the order of their start.
    lines: Vec<(String, String)>,
}

impl Faults<'_> {
    fn of(plan: &Plan) -> Faults<'_> {
        let mut signals: HashMap<FaultPort, Vec<&str>> = HashMap::new();
        for fault in &plan.faults {
            signals.entry(fault.place).or_default().push(&fault.name);
        }
        let lines = notices(plan).into_iter();
        let lines = lines.map(|notice| {
            let line = format!("fault {} {}", notice.name, notice.when());
            (notice.name.to_owned(), line)
        });
        Faults {
            signals,
            lines: lines.collect(),
        }
    }

    /// The faults that affect `link` or the samples that its reader receives.
    fn on(&self, link: &Link) -> Vec<&str> {
        let places = [
            FaultPort::Output {
                participant: link.from.0,
                port: link.from.1,
            },
            FaultPort::Input {
                participant: link.to.0,
                port: link.to.1,
            },
        ];
        let signals = places
            .iter()
            .filter_map(|place| self.signals.get(place))
            .flatten()
            .copied();
        let names: Vec<&str> = signals
            .chain(link.faults.iter().map(|fault| fault.name.as_str()))
            .collect();
        if names.is_empty() {
            return Vec::new();
        }
        let lines = self.lines.iter().filter(|(name, _)| names.contains(&name.as_str()));
        lines.map(|(_, line)| line.as_str()).collect()
    }
}

fn mermaid(known: &CheckedScenario) -> String {
    let plan = &known.plan;
    let (all, all_known) = (Faults::of(plan), known.unknown().is_empty());
    let mut text = String::from("flowchart LR\n");
    for (number, own) in plan.participants.iter().enumerate() {
        // A continuous participant has no feedthrough: it breaks every loop, and is drawn differently.
        let (open, close) = match known.interfaces[number].as_ref().map(|interface| interface.kind) {
            Some(Kind::Continuous) => ("([", "])"),
            Some(Kind::Sampled) => ("[", "]"),
            None => ("{{", "}}"),
        };
        text += &format!(
            "    p{number}{open}\"{}<br/>{}\"{close}\n",
            own.name,
            timing_text(known, all_known, number)
        );
    }
    for link in &plan.links {
        let mut label = label(link, plan);
        let faults = all.on(link);
        faults.iter().for_each(|fault| label += &format!("<br/>{fault}"));
        // A faulty link is drawn with a thick line.
        let arrow = if faults.is_empty() { "-->" } else { "==>" };
        text += &format!("    p{} {arrow}|\"{label}\"| p{}\n", link.from.0, link.to.0);
    }
    text
}

fn dot(known: &CheckedScenario) -> String {
    let plan = &known.plan;
    let (all, all_known) = (Faults::of(plan), known.unknown().is_empty());
    let mut text = String::from(
        "digraph run {\n    rankdir=LR;\n    node [fontname=\"sans-serif\"];\n    edge [fontname=\"sans-serif\"];\n",
    );
    for (number, own) in plan.participants.iter().enumerate() {
        let shape = match known.interfaces[number].as_ref().map(|interface| interface.kind) {
            Some(Kind::Continuous) => "ellipse",
            Some(Kind::Sampled) => "box",
            None => "hexagon",
        };
        text += &format!(
            "    p{number} [shape={shape}, label=\"{}\\n{}\"];\n",
            own.name,
            timing_text(known, all_known, number)
        );
    }
    for link in &plan.links {
        let mut label = label(link, plan);
        let faults = all.on(link);
        faults.iter().for_each(|fault| label += &format!("\\n{fault}"));
        let style = if faults.is_empty() { "" } else { ", style=bold" };
        text += &format!("    p{} -> p{} [label=\"{label}\"{style}];\n", link.from.0, link.to.0);
    }
    text + "}\n"
}
