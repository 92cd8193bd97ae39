//! `escapement run SCENARIO`

use crate::catalogue::catalogue;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use clap::Args;
use serde_json::json;
use tape::folder::RunFolder;

use crate::arguments::{HowArgs, ScenarioArgs};
use crate::{signals, terminal};
use engine::Progress;
use engine::campaign::Recalled;
use engine::live::{self, Server, Steering};
use engine::run::{
    Ending, Options, Origin, Outcome, Punctuality, Record, RunFailure, Traced, factor, run as run_scenario,
};
use engine::scenario::{Changes, Scenario};
use engine::shadow::{Account, Shadow};

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
    pub how: HowArgs,
}

/// Runs and reports.
pub fn run(args: &RunArgs) -> anyhow::Result<i32> {
    args.how.check_trace()?;
    if let Some(place) = &args.point {
        return again(place, args);
    }
    let scenario = match Scenario::changed(catalogue(), &args.scenario.scenario, &args.scenario.changes()) {
        Ok(scenario) => scenario,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(2);
        }
    };
    match shadows(args, &scenario) {
        Ok(shadows) => executed(&scenario, &args.how, None, &shadows, true).map(|(code, _)| code),
        Err((reason, code)) => {
            eprintln!("error: {reason}");
            Ok(code)
        }
    }
}

/// Runs a point of a campaign alone, and compares its tape with that of the campaign.
fn again(place: &Path, args: &RunArgs) -> anyhow::Result<i32> {
    let refused = |error: &dyn std::fmt::Display| {
        eprintln!("error: {error}");
        Ok(2)
    };
    let point = match Recalled::read(place) {
        Ok(point) => point,
        Err(error) => return refused(&error),
    };
    let more = args.scenario.changes();
    let spec = point.spec().and_then(|mut spec| spec.apply(&more).map(|()| spec));
    let scenario = match spec.and_then(|spec| Scenario::of(catalogue(), spec, &point.file)) {
        Ok(scenario) => scenario,
        Err(error) => return refused(&error),
    };
    let (code, outcome) = executed(&scenario, &args.how, None, &[], false)?;
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
pub fn execute(scenario: &Scenario, how: &HowArgs, origin: Option<Origin>, shadows: &[Shadow]) -> anyhow::Result<i32> {
    executed(scenario, how, origin, shadows, false).map(|(code, _)| code)
}

/// Runs `scenario`. With `warned`, the catalogue's warnings are reported while the programs start, because finding them
/// takes as long as the start.
fn begun(scenario: &Scenario, options: &Options, warned: bool) -> Result<Outcome, RunFailure> {
    let warn = |progress: Progress| {
        let warnings = catalogue().warnings(scenario);
        warnings
            .iter()
            .for_each(|warning| progress.say(&format!("warning: {warning}")));
    };
    let _watch = options.in_process.then(|| signals::Watch::over(&options.progress));
    std::thread::scope(|scope| {
        if warned {
            let progress = options.progress.clone();
            scope.spawn(|| warn(progress));
        }
        run_scenario(scenario, options)
    })
}

/// The same, with the outcome, and with the warnings about the scenario if `warned`.
fn executed(
    scenario: &Scenario,
    how: &HowArgs,
    origin: Option<Origin>,
    shadows: &[Shadow],
    warned: bool,
) -> anyhow::Result<(i32, Option<Outcome>)> {
    let server = match live(how) {
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
        progress: terminal::progress_with(how.common.quiet, address),
        ..options(how)
    };
    if how.in_process && how.common.json {
        crate::output::keep_apart();
    }
    // A shadow that is a program of its own runs in a process all the same.
    if how.in_process && shadows.is_empty() {
        how.common
            .patience_in_process()
            .iter()
            .for_each(|words| eprintln!("warning: {words}"));
    }
    let outcome = match begun(scenario, &options, warned && !how.common.quiet) {
        Ok(outcome) => outcome,
        Err(failure) => {
            eprintln!("error: {failure}");
            return Ok((failure.exit_code(), None));
        }
    };
    let mut summary = outcome.summary();
    let root = outcome.folder.clone().unwrap_or_default();
    let accounts: Vec<Account> = match &outcome.ending {
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
    tell(&outcome.ending);
    warn_of_trace_and_pace(&outcome);
    written?;
    if how.common.json {
        println!("{}", serde_json::to_string_pretty(&summary)?);
    } else if !how.common.quiet {
        print(scenario, &outcome);
        let mut out = crate::output::stdout();
        accounts
            .iter()
            .try_for_each(|account| print_account(account, &mut out))?;
    }
    if let Some((server, _)) = &server {
        farewell(how, server, &outcome)?;
    }
    Ok((outcome.exit_code(), Some(outcome)))
}

/// Warns if the pace was not kept, or the trace not written.
fn warn_of_trace_and_pace(outcome: &Outcome) {
    let complaint = outcome.punctuality.as_ref().and_then(Punctuality::complaint);
    let traced = outcome.traced.as_ref();
    let unwritten = traced.and_then(|traced| {
        let error = traced.error.as_ref()?;
        Some(format!("{}: {error}", traced.path.display()))
    });
    for words in complaint.into_iter().chain(unwritten) {
        eprintln!("warning: {words}");
    }
}

/// The options of a run from the command line, except its scenario and its page.
pub fn options(how: &HowArgs) -> Options {
    Options {
        in_process: how.in_process,
        record: Record::Folder,
        out: how.common.out.clone(),
        force: how.common.force,
        progress: terminal::progress(how.common.quiet),
        interrupt: signals::interrupt(),
        pace: how.real_time,
        overrun: how.overrun,
        trace: how.trace.clone(),
        pause_at: how.pause_at.clone(),
        checkpoint_every: how.checkpoint_every,
        checkpoint_at: how.checkpoint_at.clone(),
        wait: how.wait,
        no_placement: how.no_placement,
        patience_s: how.common.patience_s(),
        start_within: how.common.start_within(),
        ..Options::default()
    }
}

/// The server of the page, if requested.
fn live(how: &HowArgs) -> Result<Option<(Server, Arc<Steering>)>, String> {
    let Some(port) = how.live.or(how.live_stay.then_some(0)) else {
        return Ok(None);
    };
    let steering = Arc::new(Steering::default());
    let server =
        Server::start(port, steering.clone(), catalogue().views()).map_err(|error| live::refusal(port, &error))?;
    Ok(Some((server, steering)))
}

/// The run is over and its folder complete: open pages get the complete data.
fn farewell(how: &HowArgs, server: &Server, outcome: &Outcome) -> anyhow::Result<()> {
    server.finish(outcome.ending.words().unwrap_or_else(|| "complete".to_owned()));
    if !how.live_stay || matches!(outcome.ending, Ending::Stopped { .. }) {
        return Ok(());
    }
    let interrupt = signals::interrupt();
    eprintln!("live: the run is over; the page stays until Ctrl-C: {}", server.url());
    while !interrupt.asked() {
        std::thread::sleep(Duration::from_millis(50));
    }
    Ok(())
}

/// The requested shadows, checked as far as possible before the run.
///
/// # Errors
/// The mistake in one of them, and the exit code.
fn shadows(args: &RunArgs, scenario: &Scenario) -> Result<Vec<Shadow>, (String, i32)> {
    let options = Options {
        interrupt: signals::interrupt(),
        start_within: args.how.common.start_within(),
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
        "{:.3} s simulated in {:.3} s: {} times real time ({})",
        outcome.simulated_s,
        outcome.wall_s,
        factor(outcome.real_time_factor()),
        outcome.placement
    );
    outcome.punctuality.iter().for_each(print_pace);
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
fn print_trace(traced: &Traced) {
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

/// Reports how the run kept pace with the wall clock.
fn print_pace(pace: &Punctuality) {
    let held = pace.held.map_or_else(|| "not known".to_owned(), factor);
    println!("pace: {held} times real time held of {}", factor(pace.asked));
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
pub fn tell(ending: &Ending) {
    let error = if matches!(ending, Ending::Failed { .. }) {
        "error: "
    } else {
        ""
    };
    if let Some(words) = ending.words() {
        eprintln!("{error}{words}");
    }
}

/// The result of a shadow as text.
fn print_account(account: &Account, out: &mut impl Write) -> std::io::Result<()> {
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
