//! `orchestrator run SCENARIO`

use std::sync::Arc;
use std::time::Duration;

use recorder::folder::RunFolder;

use crate::cli::RunArgs;
use crate::live::{self, Server, Steering};
use crate::run::signals::Interrupt;
use crate::run::{Ending, Options, Outcome, run as run_scenario};
use crate::scenario::Scenario;

/// Runs and reports.
pub fn run(args: &RunArgs) -> anyhow::Result<i32> {
    if args.real_time.is_some_and(|pace| !(pace.is_finite() && pace > 0.0)) {
        eprintln!("error: --real-time takes a factor above zero");
        return Ok(2);
    }
    let scenario = match Scenario::read(&args.scenario.scenario, &args.scenario.overrides()) {
        Ok(scenario) => scenario,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(2);
        }
    };
    let server = match live(args) {
        Ok(server) => server,
        Err(reason) => {
            eprintln!("error: {reason}");
            return Ok(2);
        }
    };
    let options = Options {
        in_process: args.in_process,
        out: args.out.clone(),
        quiet: args.quiet,
        pace: args.real_time,
        pause_at: args.pause_at.clone(),
        wait: args.wait,
        no_placement: args.no_placement,
        patience_s: args.patience.seconds(),
        steering: server.as_ref().map(|(_, steering)| steering.clone()),
    };
    let outcome = match run_scenario(&scenario, &options) {
        Ok(outcome) => outcome,
        Err(failure) => {
            eprintln!("error: {failure}");
            return Ok(failure.exit_code());
        }
    };
    let summary = outcome.summary();
    let folder = RunFolder::open(&outcome.folder);
    folder.write_json(&folder.summary(), &summary)?;
    match &outcome.ending {
        Ending::Complete => {}
        Ending::Stopped { reason } => eprintln!("{reason}"),
        Ending::Failed { participant, reason } => eprintln!("error: participant `{participant}` {reason}"),
    }
    if args.json {
        println!("{}", serde_json::to_string_pretty(&summary)?);
    } else if !args.quiet {
        print(&scenario, &outcome);
    }
    if let Some((server, _)) = &server {
        farewell(args, server, &outcome)?;
    }
    Ok(outcome.exit_code())
}

/// The server of the page, where one is asked for.
fn live(args: &RunArgs) -> Result<Option<(Server, Arc<Steering>)>, String> {
    let Some(port) = args.live.or(args.live_stay.then_some(0)) else {
        return Ok(None);
    };
    let steering = Arc::new(Steering::default());
    let server = Server::start(port, steering.clone()).map_err(|error| live::refusal(port, &error))?;
    eprintln!("live: {}", server.url());
    Ok(Some((server, steering)))
}

/// The run is over and its folder complete: pages that are open get the whole of it.
fn farewell(args: &RunArgs, server: &Server, outcome: &Outcome) -> anyhow::Result<()> {
    server.finish(match &outcome.ending {
        Ending::Complete => "complete".to_owned(),
        Ending::Stopped { reason } => reason.clone(),
        Ending::Failed { participant, reason } => format!("participant `{participant}` {reason}"),
    });
    if !args.live_stay || matches!(outcome.ending, Ending::Stopped { .. }) {
        return Ok(());
    }
    let interrupt = Interrupt::install()?;
    eprintln!("live: the run is over; the page stays until Ctrl-C: {}", server.url());
    while !interrupt.asked() {
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}

fn print(scenario: &Scenario, outcome: &Outcome) {
    if !scenario.title.is_empty() {
        println!("{}", scenario.title);
    }
    if let Some(figures) = &outcome.figures {
        println!("{figures}");
    }
    println!(
        "{:.3} s simulated in {:.3} s: {:.0} times real time ({})",
        outcome.simulated_s,
        outcome.wall_s,
        outcome.real_time_factor(),
        outcome.placement
    );
    println!("run folder: {}", outcome.folder.display());
}
