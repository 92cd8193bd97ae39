//! `escapement check SCENARIO`: everything but the launch.

use crate::program::catalogue;
use lockstep::plan::Plan;
use serde_json::json;

use crate::cli::CheckArgs;
use engine::run::{Options, check, faults, placement, room};
use engine::scenario::{Program, Scenario};

/// Plans and says what would run.
pub fn run(args: &CheckArgs) -> anyhow::Result<i32> {
    let read = Scenario::read(catalogue(), &args.scenario.scenario, &args.scenario.overrides());
    let checked = read.and_then(|scenario| check(&scenario).map(|known| (scenario, known)));
    let (scenario, known) = match checked {
        Ok(checked) => checked,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(2);
        }
    };
    for remark in catalogue().remarks(&scenario) {
        eprintln!("warning: {remark}");
    }
    let placement = placement(&known.plan, &Options::default());
    if args.json {
        let plan = serde_json::to_value(&known.plan)?;
        println!(
            "{}",
            serde_json::to_string_pretty(&json!({
                "plan": plan,
                "placement": placement.reason,
                "shared_memory": room::figures(&known.plan),
            }))?
        );
        return Ok(0);
    }
    describe(&scenario, &known.plan);
    for (entry, interface) in scenario.participants.iter().zip(&known.interfaces) {
        if interface.is_none() {
            println!(
                "the ports of {} are known when its program runs; here they are assumed to fit",
                entry.setup.name
            );
        }
    }
    println!("placement: {}", placement.reason);
    println!("{}", room::describe(&known.plan));
    Ok(0)
}

fn program(program: &Program) -> String {
    match program {
        Program::Builtin(name) => format!("builtin {name}"),
        Program::External { exe, .. } => exe.display().to_string(),
    }
}

fn describe(scenario: &Scenario, plan: &Plan) {
    println!("{}: {}", scenario.name, scenario.title);
    println!(
        "duration {}, tick {}, seed {}",
        scenario.duration,
        plan.timebase.tick(),
        plan.seed
    );
    let mut order: Vec<usize> = (0..plan.participants.len()).collect();
    order.sort_by_key(|&number| plan.participants[number].rank);
    println!("participants, in the order of activations at one instant:");
    for number in order {
        let own = &plan.participants[number];
        let program = program(&scenario.participants[number].program);
        println!(
            "  {:<16} {:?} every {} from {}, {} activations ({program})",
            own.name, own.interface.kind, own.period, own.offset, own.activations
        );
    }
    println!("connections:");
    for link in &plan.links {
        let mut timing = format!("delay {}", link.timing.delay);
        if link.timing.jitter.is_positive() {
            timing += &format!(", jitter up to {}", link.timing.jitter);
        }
        if link.timing.drop > 0.0 {
            timing += &format!(", drops {} %", 100.0 * link.timing.drop);
        }
        println!(
            "  {:<24} {} -> {} ({timing}, room for {} samples)",
            link.name,
            plan.output_name(link.from),
            plan.input_name(link.to),
            link.capacity
        );
    }
    if scenario.guards().next().is_some() {
        println!("guards:");
    }
    for (name, words) in scenario.guards() {
        println!("  {name:<24} {words}");
    }
    let faults = faults::notices(plan);
    if !faults.is_empty() {
        println!("faults:");
    }
    for fault in faults {
        println!("  {:<24} {}, {}", fault.name, fault.words, fault.when());
    }
    for substitution in &scenario.substitutions {
        println!(
            "  {:<24} {} takes the place of {} at {}, {} state, {} parameters",
            substitution.name,
            program(&substitution.program),
            scenario.participants[substitution.participant].setup.name,
            substitution.at,
            substitution.state.name(),
            if substitution.parameters.is_some() {
                "its own"
            } else {
                "the same"
            },
        );
    }
}
