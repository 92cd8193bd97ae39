//! `orchestrator graph SCENARIO`: a drawing of who tells whom what, how often and how late.

use lockstep::participant::Kind;
use lockstep::plan::{Link, Plan};

use crate::cli::{GraphArgs, GraphFormat};
use crate::run::check;
use crate::scenario::Scenario;

/// Prints the drawing.
pub fn run(args: &GraphArgs) -> anyhow::Result<i32> {
    let read = Scenario::read(&args.scenario.scenario, &args.scenario.overrides());
    match read.and_then(|scenario| check(&scenario)) {
        Ok(known) => {
            print!("{}", draw(&known.plan, args.format));
            Ok(0)
        }
        Err(error) => {
            eprintln!("error: {error}");
            Ok(2)
        }
    }
}

fn draw(plan: &Plan, format: GraphFormat) -> String {
    match format {
        GraphFormat::Mermaid => mermaid(plan),
        GraphFormat::Dot => dot(plan),
    }
}

fn label(link: &Link, plan: &Plan) -> String {
    let port = &plan.participants[link.from.0].interface.outputs[link.from.1].name;
    let mut label = port.clone();
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

fn mermaid(plan: &Plan) -> String {
    let mut text = String::from("flowchart LR\n");
    for (number, own) in plan.participants.iter().enumerate() {
        // A continuous participant has no feedthrough: it breaks every circle, and looks different.
        let (open, close) = if own.interface.kind == Kind::Continuous {
            ("([", "])")
        } else {
            ("[", "]")
        };
        text += &format!(
            "    p{number}{open}\"{}<br/>every {}, order {}\"{close}\n",
            own.name,
            own.period,
            own.rank + 1
        );
    }
    for link in &plan.links {
        text += &format!("    p{} -->|\"{}\"| p{}\n", link.from.0, label(link, plan), link.to.0);
    }
    text
}

fn dot(plan: &Plan) -> String {
    let mut text = String::from(
        "digraph run {\n    rankdir=LR;\n    node [fontname=\"sans-serif\"];\n    edge [fontname=\"sans-serif\"];\n",
    );
    for (number, own) in plan.participants.iter().enumerate() {
        let shape = if own.interface.kind == Kind::Continuous {
            "ellipse"
        } else {
            "box"
        };
        text += &format!(
            "    p{number} [shape={shape}, label=\"{}\\nevery {}, order {}\"];\n",
            own.name,
            own.period,
            own.rank + 1
        );
    }
    for link in &plan.links {
        text += &format!(
            "    p{} -> p{} [label=\"{}\"];\n",
            link.from.0,
            link.to.0,
            label(link, plan)
        );
    }
    text + "}\n"
}
