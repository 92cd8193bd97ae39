//! `escapement check SCENARIO`: everything but the run.

use std::io::Write;

use clap::Args;
use serde_json::{Value, json};

use crate::arguments::{ScenarioArgs, StartArgs};
use crate::catalogue::catalogue;
use crate::output;
use engine::run::{CheckedScenario, Options, Placement, RunFailure, faults, resources};
use engine::scenario::{Program, Scenario};
use lockstep::link::Hold;
use lockstep::plan::Link;

/// Arguments of `check`.
#[derive(Debug, Args)]
pub struct CheckArgs {
    /// The scenario
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// The programs to query
    #[command(flatten)]
    pub start: StartArgs,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// Plans the run and prints the plan.
pub fn run(args: &CheckArgs) -> anyhow::Result<i32> {
    let read = Scenario::changed(catalogue(), &args.scenario.scenario, &args.scenario.changes());
    let checked = read.map_err(RunFailure::from);
    let checked = checked.and_then(|scenario| args.start.check(&scenario).map(|known| (scenario, known)));
    let (scenario, known) = match checked {
        Ok(checked) => checked,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(error.exit_code());
        }
    };
    let findings = catalogue().findings(&scenario);
    for warning in catalogue().warnings_with(&scenario, &findings) {
        eprintln!("warning: {warning}");
    }
    let placement = Placement::choose(&known.plan, &Options::default());
    if args.json {
        let (plan, unknown) = (json_of(&known)?, known.unknown());
        let mut result = json!({
            "plan": plan,
            "unknown": unknown,
            "placement": placement.reason,
            "shared_memory": resources::figures(&known.plan),
        });
        for one in findings {
            result[one.name] = one.value;
        }
        println!("{}", serde_json::to_string_pretty(&result)?);
        return Ok(0);
    }
    let out = &mut output::buffered_stdout();
    describe(out, &scenario, &known);
    say!(out, "placement: {}", placement.reason);
    say!(out, "{}", resources::describe(&known.plan));
    findings.iter().for_each(|one| say!(out, "{}", one.text));
    Ok(0)
}

/// The plan, without assumptions about participants that were not queried.
fn json_of(known: &CheckedScenario) -> serde_json::Result<Value> {
    let mut plan = serde_json::to_value(&known.plan)?;
    if known.unknown().is_empty() {
        return Ok(plan);
    }
    let assumed: Vec<bool> = known.interfaces.iter().map(Option::is_none).collect();
    for (participant, assumed) in plan["participants"].as_array_mut().into_iter().flatten().zip(&assumed) {
        participant["rank"] = Value::Null;
        if *assumed {
            participant["interface"] = Value::Null;
        }
    }
    for (link, about) in plan["links"]
        .as_array_mut()
        .into_iter()
        .flatten()
        .zip(&known.plan.links)
    {
        if assumed[about.from.0] {
            link["initial"] = Value::Null;
        }
    }
    Ok(plan)
}

fn program(program: &Program) -> String {
    match program {
        Program::Builtin(name) => format!("builtin {name}"),
        Program::Library {
            file,
            participant: None,
        } => format!("library {}", file.display()),
        Program::Library {
            file,
            participant: Some(participant),
        } => format!("{participant} of library {}", file.display()),
        Program::Fmu { file, .. } => format!("FMU {}", file.display()),
        Program::External { exe, .. } => exe.display().to_string(),
    }
}

fn describe(out: &mut impl Write, scenario: &Scenario, known: &CheckedScenario) {
    let (plan, unknown) = (&known.plan, known.unknown());
    say!(out, "{}: {}", scenario.name, scenario.title);
    say!(
        out,
        "duration {}, tick {}, seed {}",
        scenario.duration,
        plan.timebase.tick(),
        plan.seed
    );
    describe_participants(out, scenario, known, &unknown);
    say!(out, "connections:");
    for link in &plan.links {
        describe_link(out, known, link);
    }
    if scenario.guards().next().is_some() {
        say!(out, "guards:");
    }
    for (name, words) in scenario.guards() {
        say!(out, "  {name:<24} {words}");
    }
    let faults = faults::notices(plan);
    if !faults.is_empty() {
        say!(out, "faults:");
    }
    for fault in faults {
        say!(out, "  {:<24} {}, {}", fault.name, fault.description, fault.when());
    }
    for substitution in &scenario.substitutions {
        say!(
            out,
            "  {:<24} {} takes the place of {} at {}, {} state, {} parameters",
            substitution.name,
            program(&substitution.entry.program),
            scenario.participants[substitution.participant].setup.name,
            substitution.at,
            substitution.state.name(),
            if substitution.own_parameters {
                "its own"
            } else {
                "the same"
            },
        );
    }
}

fn describe_participants(out: &mut impl Write, scenario: &Scenario, known: &CheckedScenario, unknown: &[&str]) {
    let plan = &known.plan;
    let mut order: Vec<usize> = (0..plan.participants.len()).collect();
    if unknown.is_empty() {
        order.sort_by_key(|&number| plan.participants[number].rank);
        say!(out, "participants, in the order of activations at one instant:");
    } else {
        say!(
            out,
            "participants, by name; the order of activations at one instant is unknown:"
        );
    }
    for number in order {
        let own = &plan.participants[number];
        let program = program(&scenario.participants[number].program);
        let kind = match &known.interfaces[number] {
            Some(interface) => format!("{:?}", interface.kind),
            None => "of unknown kind,".to_owned(),
        };
        say!(
            out,
            "  {:<16} {kind} every {} from {}, {} activations ({program})",
            own.name,
            own.period,
            own.offset,
            own.activations
        );
    }
    if !unknown.is_empty() {
        say!(
            out,
            "not asked: {}. Kind and ports are unknown, and so is whether they fit, whether all inputs are fed, and whether there \
             is an algebraic loop: --start asks",
            unknown.join(", ")
        );
    }
}

fn describe_link(out: &mut impl Write, known: &CheckedScenario, link: &Link) {
    let plan = &known.plan;
    let mut timing = format!("delay {}", link.timing.delay);
    if link.timing.jitter.is_positive() {
        timing += &format!(", jitter up to {}", link.timing.jitter);
    }
    if link.timing.drop > 0.0 {
        timing += &format!(", drops {} %", 100.0 * link.timing.drop);
    }
    if link.timing.hold == Hold::Linear {
        timing += ", interpolated";
    }
    say!(
        out,
        "  {:<24} {} -> {} ({timing}, room for {} samples)",
        link.name,
        plan.output_name(link.from),
        plan.input_name(link.to),
        link.capacity
    );
    let taken = &plan.participants[link.to.0].interface.inputs[link.to.1].descriptor;
    let certain = [link.from.0, link.to.0]
        .iter()
        .all(|&end| known.interfaces[end].is_some());
    match &link.conversion {
        Some(conversion) if certain => (conversion.describe(taken).iter()).for_each(|words| say!(out, "    {words}")),
        Some(_) => say!(out, "    between fields of ports that are not known"),
        None => {}
    }
}
