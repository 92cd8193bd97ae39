//! `escapement run SCENARIO`: one run, its shadows, and the report of its end.

use crate::catalogue::catalogue;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use serde_json::json;
use tape::folder::RunFolder;

use crate::arguments::{ExecutionArgs, ScenarioArgs};
use crate::{signals, terminal};
use engine::Progress;
use engine::campaign::StoredPoint;
use engine::live::{self, Server, Steering};
use engine::run::{
    Ending, Options, Origin, Outcome, PaceReport, Record, RunFailure, TraceSummary, factor, run as run_scenario,
};
use engine::scenario::{Changes, Scenario};
use engine::shadow::{Shadow, ShadowReport};

/// Arguments of `run`.
#[derive(Debug, Args)]
pub struct RunArgs {
    /// The scenario
    #[command(flatten)]
    pub scenario: ScenarioArgs,
    /// Run this point of a campaign alone and with its whole tape, instead of a scenario; the digest is the same
    #[arg(long, value_name = "FOLDER:NUMBER", conflicts_with_all = ["scenario", "shadow"])]
    pub point: Option<PathBuf>,
    /// Feed the inputs of a participant to a second program too, and report where its outputs differ: a file, or builtin:NAME
    /// (may be given more than once)
    #[arg(long, value_name = "PARTICIPANT=PROGRAM")]
    pub shadow: Vec<String>,
    /// Change a parameter of the shadows, such as law=\"reference\" (may be given more than once)
    #[arg(long, value_name = "KEY.PATH=VALUE", requires = "shadow")]
    pub shadow_set: Vec<String>,
    /// How to run it
    #[command(flatten)]
    pub execution: ExecutionArgs,
}

/// Runs and reports.
pub fn run(args: &RunArgs) -> anyhow::Result<i32> {
    args.execution.check_trace()?;
    if let Some(place) = &args.point {
        return rerun_point(place, args);
    }
    let scenario = match Scenario::changed(catalogue(), &args.scenario.scenario, &args.scenario.changes()) {
        Ok(scenario) => scenario,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(2);
        }
    };
    match read_shadows(args, &scenario) {
        Ok(shadows) => run_and_report(&scenario, &args.execution, None, &shadows, true).map(|(code, _)| code),
        Err((reason, code)) => {
            eprintln!("error: {reason}");
            Ok(code)
        }
    }
}

/// Runs one point of a campaign, and compares its tape with that of the campaign.
fn rerun_point(place: &Path, args: &RunArgs) -> anyhow::Result<i32> {
    let refused = |error: &dyn std::fmt::Display| {
        eprintln!("error: {error}");
        Ok(2)
    };
    let point = match StoredPoint::read(place) {
        Ok(point) => point,
        Err(error) => return refused(&error),
    };
    let more = args.scenario.changes();
    let spec = point.spec().and_then(|mut spec| spec.apply(&more).map(|()| spec));
    let scenario = match spec.and_then(|spec| Scenario::of(catalogue(), spec, &point.file)) {
        Ok(scenario) => scenario,
        Err(error) => return refused(&error),
    };
    let (code, outcome) = run_and_report(&scenario, &args.execution, None, &[], false)?;
    let common = || Scenario::changed(catalogue(), &point.file, point.common()).ok();
    // With changes on the command line it is another run.
    let compared = outcome.filter(|_| more == Changes::default()).zip(common());
    if let Some(difference) = compared.and_then(|(outcome, common)| point.difference(&common, &outcome)) {
        eprintln!("error: {difference}");
        return Ok(3);
    }
    Ok(code)
}

/// Runs `scenario`, from `origin` if there is one, with `shadows`, and reports.
pub fn execute(
    scenario: &Scenario,
    execution: &ExecutionArgs,
    origin: Option<Origin>,
    shadows: &[Shadow],
) -> anyhow::Result<i32> {
    run_and_report(scenario, execution, origin, shadows, false).map(|(code, _)| code)
}

/// Runs `scenario`. With `warned`, the catalogue's warnings are reported while the programs start, because finding them
/// takes as long as the start.
fn run_with_warnings(scenario: &Scenario, options: &Options, warned: bool) -> Result<Outcome, RunFailure> {
    let warn = |progress: Progress| {
        let warnings = catalogue().warnings(scenario);
        warnings
            .iter()
            .for_each(|warning| progress.notice(&format!("warning: {warning}")));
    };
    let _watch = options
        .in_process
        .then(|| signals::StallWatch::start(&options.progress));
    std::thread::scope(|scope| {
        if warned {
            let progress = options.progress.clone();
            scope.spawn(|| warn(progress));
        }
        run_scenario(scenario, options)
    })
}

/// The same, with the outcome, and with the warnings about the scenario if `warned`.
fn run_and_report(
    scenario: &Scenario,
    execution: &ExecutionArgs,
    origin: Option<Origin>,
    shadows: &[Shadow],
    warned: bool,
) -> anyhow::Result<(i32, Option<Outcome>)> {
    let server = match start_live_server(execution) {
        Ok(server) => server,
        Err(reason) => {
            eprintln!("error: {reason}");
            return Ok((2, None));
        }
    };
    // Before the run is accepted there is nothing to see at the address.
    let address = server.as_ref().map(|(server, _)| format!("live: {}", server.url()));
    let options = Options {
        origin,
        steering: server.as_ref().map(|(_, steering)| steering.clone()),
        progress: terminal::progress_with(execution.common.quiet, address),
        ..options(execution)
    };
    if execution.in_process && execution.common.json {
        crate::output::separate_stdout();
    }
    // A shadow that is a separate program runs in a process nevertheless.
    if execution.in_process && shadows.is_empty() {
        execution
            .common
            .patience_in_process()
            .iter()
            .for_each(|words| eprintln!("warning: {words}"));
    }
    let outcome = match run_with_warnings(scenario, &options, warned && !execution.common.quiet) {
        Ok(outcome) => outcome,
        Err(failure) => {
            eprintln!("error: {failure}");
            return Ok((failure.exit_code(), None));
        }
    };
    let mut summary = outcome.summary();
    let root = outcome.folder.clone().unwrap_or_default();
    let accounts: Vec<ShadowReport> = match &outcome.ending {
        // If the user stops the run, the shadows are not run either.
        Ending::Stopped { .. } => Vec::new(),
        _ => shadows
            .iter()
            .map(|shadow| shadow.run(catalogue(), &root, &options))
            .collect(),
    };
    if !shadows.is_empty() {
        summary["shadows"] = json!(accounts);
    }
    let folder = RunFolder::open(&root);
    let written = folder.write_json(&folder.summary(), &summary);
    print_ending(&outcome.ending);
    warn_of_trace_and_pace(&outcome);
    written?;
    if execution.common.json {
        println!("{}", serde_json::to_string_pretty(&summary)?);
    } else if !execution.common.quiet {
        print(scenario, &outcome);
        let mut out = crate::output::stdout();
        accounts
            .iter()
            .try_for_each(|account| print_account(account, &mut out))?;
    }
    if let Some((server, _)) = &server {
        finish_live_page(execution, server, &outcome)?;
    }
    Ok((outcome.exit_code(), Some(outcome)))
}

/// Warns if the pace was not met, or the trace not written.
fn warn_of_trace_and_pace(outcome: &Outcome) {
    let warning = outcome.pace.as_ref().and_then(PaceReport::warning);
    let traced = outcome.traced.as_ref();
    let unwritten = traced.and_then(|traced| {
        let error = traced.error.as_ref()?;
        Some(format!("{}: {error}", traced.path.display()))
    });
    for words in warning.into_iter().chain(unwritten) {
        eprintln!("warning: {words}");
    }
}

/// The options of a run from the command line, except its scenario and its page.
pub fn options(execution: &ExecutionArgs) -> Options {
    Options {
        in_process: execution.in_process,
        record: Record::Folder,
        out: execution.common.out.clone(),
        force: execution.common.force,
        progress: terminal::progress(execution.common.quiet),
        interrupt: signals::interrupt(),
        pace: execution.real_time,
        overrun: execution.overrun,
        trace: execution.trace.clone(),
        pause_at: execution.pause_at.clone(),
        checkpoint_every: execution.checkpoint_every,
        checkpoint_at: execution.checkpoint_at.clone(),
        wait: execution.wait,
        no_placement: execution.no_placement,
        patience_s: execution.common.patience_s(),
        start_within: execution.common.start_within(),
        ..Options::default()
    }
}

/// The server of the page, if requested.
fn start_live_server(execution: &ExecutionArgs) -> Result<Option<(Server, Arc<Steering>)>, String> {
    let Some(port) = execution.live.or(execution.live_stay.then_some(0)) else {
        return Ok(None);
    };
    let steering = Arc::new(Steering::default());
    let server =
        Server::start(port, steering.clone(), catalogue().views()).map_err(|error| live::refusal(port, &error))?;
    Ok(Some((server, steering)))
}

/// Sends the complete data to open pages, after the run has completed its folder; with `--live-stay`, serves them until Ctrl-C.
fn finish_live_page(execution: &ExecutionArgs, server: &Server, outcome: &Outcome) -> anyhow::Result<()> {
    server.finish(outcome.ending.reason().unwrap_or_else(|| "complete".to_owned()));
    if !execution.live_stay || matches!(outcome.ending, Ending::Stopped { .. }) {
        return Ok(());
    }
    let interrupt = signals::interrupt();
    eprintln!("live: the run is over; the page stays until Ctrl-C: {}", server.url());
    while !interrupt.is_requested() {
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}

/// Reads the requested shadows, and checks them as far as possible before the run.
///
/// # Errors
/// The mistake in one of them, and the exit code.
fn read_shadows(args: &RunArgs, scenario: &Scenario) -> Result<Vec<Shadow>, (String, i32)> {
    let options = Options {
        interrupt: signals::interrupt(),
        start_within: args.execution.common.start_within(),
        ..Options::default()
    };
    let read = |text: &String| {
        let shadow = Shadow::read(text, &args.shadow_set).map_err(|reason| (reason, 2))?;
        let checked = shadow.check(catalogue(), &args.scenario.scenario, scenario.spec(), &options);
        let failed = |failure: RunFailure| (failure.to_string(), failure.exit_code());
        checked.map(|()| shadow).map_err(failed)
    };
    args.shadow.iter().map(read).collect()
}

fn print(scenario: &Scenario, outcome: &Outcome) {
    if !scenario.title.is_empty() {
        println!("{}", scenario.title);
    }
    if let Some(figures) = &outcome.figures {
        println!("{}", figures.text());
    }
    println!(
        "{:.3} s simulated{} in {:.3} s: {} times real time ({})",
        outcome.own_simulated_s(),
        outcome
            .resumed_s
            .map_or(String::new(), |from| format!(" from t = {from} s on")),
        outcome.wall_s,
        factor(outcome.real_time_factor()),
        outcome.placement
    );
    outcome.pace.iter().for_each(print_pace);
    if let Some(traced) = &outcome.traced {
        print_trace(traced);
    }
    if !outcome.partial.is_empty() {
        println!("the tape has only: {}", outcome.partial.join(", "));
    }
    for what in &outcome.recovered {
        println!("recovered: {what}");
    }
    if let Some(folder) = &outcome.folder {
        println!("run folder: {}", folder.display());
    }
}

/// Reports the file of a trace.
fn print_trace(traced: &TraceSummary) {
    let file = traced.path.display();
    let cut = match traced.missing {
        0 => String::new(),
        missing => format!(", {missing} more are missing"),
    };
    match &traced.error {
        Some(reason) => println!("trace: {file} is incomplete: {reason}"),
        None => println!("trace: {file} ({} spans{cut})", traced.spans),
    }
}

/// Reports how the run followed the wall clock.
fn print_pace(pace: &PaceReport) {
    let achieved = pace.achieved.map_or_else(|| "not known".to_owned(), factor);
    println!(
        "pace: {achieved} times real time of {} requested",
        factor(pace.requested)
    );
    let width = pace.participants.keys().map(String::len).max().unwrap_or(0).max(11);
    println!(
        "  {:width$}       p50       p99     p99.9   largest  overruns (ms late)",
        ""
    );
    for (name, one) in &pace.participants {
        if one.steps == 0 {
            println!("  {name:width$}  does not say when its steps are complete");
            continue;
        }
        let ms = [
            one.lateness_p50_s,
            one.lateness_p99_s,
            one.lateness_p999_s,
            one.lateness_largest_s,
        ]
        .map(|s| format!("{:9.3}", s * 1e3));
        println!("  {name:width$} {}  {} of {}", ms.join(" "), one.overruns, one.steps);
    }
}

/// Reports how a run ended, where this needs a message.
pub fn print_ending(ending: &Ending) {
    let error = if matches!(ending, Ending::Failed { .. }) {
        "error: "
    } else {
        ""
    };
    if let Some(words) = ending.reason() {
        eprintln!("{error}{words}");
    }
}

/// The result of a shadow as text.
fn print_account(account: &ShadowReport, out: &mut impl Write) -> std::io::Result<()> {
    writeln!(
        out,
        "shadow of `{}`, {} (A is the run, B the shadow):",
        account.participant, account.program
    )?;
    for note in &account.notes {
        writeln!(out, "  note: {note}")?;
    }
    if let Some(refused) = &account.refused {
        writeln!(out, "  not compared: {refused}")?;
    }
    match &account.ending {
        Some(Ending::Failed { reason, .. }) => writeln!(out, "  the shadow failed, the run did not: {reason}")?,
        Some(Ending::Stopped { reason }) => writeln!(out, "  {reason}")?,
        Some(Ending::Complete) | None => {}
    }
    match &account.comparison {
        Some(comparison) => super::compare::print(out, comparison),
        None => Ok(()),
    }
}
