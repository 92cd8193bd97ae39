//! `escapement replay RUN --participant NAME`: repeats one participant with its recorded inputs.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use lockstep::time::Rational;
use serde_json::json;

use super::compare::{DIFFERENT, print};
use super::seal::{SealArgs, read_error_text};
use crate::arguments::{CommonArgs, parse_duration, parse_instant};
use crate::catalogue::catalogue;
use crate::output;
use crate::{signals, terminal};
use engine::replay::{Found, Replay, ReplayError, Request};
use engine::run::{Ending, Options, Wait};

/// Exit code: no sample was compared.
const UNCOMPARED: i32 = 2;

/// Arguments of `replay`.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// The folder of a run
    pub run: PathBuf,
    /// The participant to run again
    #[arg(long, short)]
    pub participant: String,
    /// Run this program instead, with the arguments after `--`
    #[arg(long, value_name = "PATH")]
    pub exe: Option<PathBuf>,
    /// Run the participant in a process of its own over shared memory, as in the run; by default a participant that this program
    /// contains runs in this process
    #[arg(long)]
    pub process: bool,
    /// Change a key of the plan, such as participants.controller.parameters.law=\"reference\" (may be given more than once)
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Replay only the activations before this simulated time
    #[arg(long, value_name = "TIME", value_parser = parse_duration)]
    pub to: Option<Rational>,
    /// Pause before the first step, or at this simulated time, print the process number, and wait for Enter
    #[arg(long, value_name = "TIME", num_args = 0..=1, default_missing_value = "0 s", require_equals = true, value_parser = parse_instant)]
    pub wait_for_debugger: Option<Rational>,
    /// What every run takes
    #[command(flatten)]
    pub common: CommonArgs,
    /// Whether a damaged tape is replayed
    #[command(flatten)]
    pub seal: SealArgs,
    /// Arguments of the program named with --exe
    #[arg(last = true, requires = "exe")]
    pub args: Vec<String>,
}

/// Replays and prints; returns the exit code.
pub fn run(args: &ReplayArgs) -> anyhow::Result<i32> {
    match replay(args) {
        Ok(found) => report(args, &found),
        Err(error) => {
            match &error {
                ReplayError::Tape(of_tape) => eprintln!("error: {}", read_error_text(of_tape)),
                other => eprintln!("error: {other}"),
            }
            Ok(error.exit_code())
        }
    }
}

fn replay(args: &ReplayArgs) -> Result<Found, ReplayError> {
    args.common
        .check_does_not_replace(&args.run)
        .map_err(ReplayError::Misfit)?;
    let exe = args.exe.as_ref().map(std::path::absolute).transpose();
    let exe = exe.map_err(|error| ReplayError::Misfit(format!("--exe: {error}")))?;
    let replay = Replay::plan(&Request {
        catalogue: catalogue(),
        folder: &args.run,
        participant: &args.participant,
        overrides: &args.set,
        program: exe.as_deref().map(|exe| (exe, args.args.as_slice())),
        run: None,
        to: args.to,
        unverified: args.seal.unverified,
    })?;
    if let Some(at) = args.wait_for_debugger.filter(|at| *at >= replay.end()) {
        return Err(ReplayError::Misfit(format!(
            "--wait-for-debugger {at}: the replay ends at t = {}: give an earlier time",
            replay.end()
        )));
    }
    let in_process = !args.process && !replay.external();
    if in_process && args.common.json {
        output::separate_stdout();
    }
    if in_process {
        args.common
            .patience_in_process()
            .iter()
            .for_each(|words| eprintln!("warning: {words}"));
    }
    let options = Options {
        in_process,
        out: args.common.out.clone(),
        force: args.common.force,
        progress: terminal::progress(args.common.quiet),
        interrupt: signals::interrupt(),
        pause_at: args.wait_for_debugger.into_iter().collect(),
        wait: Wait::Auto,
        // A participant that is stopped in a debugger must not run into a timeout.
        patience_s: match args.wait_for_debugger {
            Some(_) => f64::INFINITY,
            None => args.common.patience_s(),
        },
        start_within: args.common.start_within(),
        ..Options::default()
    };
    let _watch = options
        .in_process
        .then(|| signals::StallWatch::start(&options.progress));
    replay.run(&options)
}

fn report(args: &ReplayArgs, found: &Found) -> anyhow::Result<i32> {
    for note in &found.notes {
        eprintln!("note: {note}");
    }
    super::run::print_ending(&found.ending);
    let failed = found.ending != Ending::Complete;
    let mut out = output::stdout();
    if args.common.json {
        let result = json!({
            "participant": args.participant,
            "ending": found.ending,
            "to_s": found.to_s,
            "notes": found.notes,
            "comparison": found.comparison.as_ref().ok(),
            "refused": found.comparison.as_ref().err(),
        });
        serde_json::to_writer_pretty(&mut out, &result)?;
        writeln!(out)?;
    } else if let Ok(comparison) = &found.comparison
        && !args.common.quiet
    {
        writeln!(
            out,
            "`{}` of {} (A) and again (B), up to t = {} s:",
            args.participant,
            args.run.display(),
            found.to_s
        )?;
        print(&mut out, comparison)?;
    }
    if let Err(reason) = &found.comparison {
        eprintln!("error: {reason}");
    }
    Ok(match &found.comparison {
        _ if failed => 1,
        Ok(comparison) if comparison.identical => 0,
        Ok(_) => DIFFERENT,
        Err(_) => UNCOMPARED,
    })
}
