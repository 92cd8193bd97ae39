//! `escapement replay RUN --participant NAME`: repeats one participant with its recorded inputs.

use std::io::Write;
use std::path::PathBuf;

use clap::Args;
use lockstep::time::Rational;
use serde_json::json;

use super::compare::{DIFFERENT, print};
use super::trust::{Trust, told};
use crate::arguments::{CommonArgs, instant, span};
use crate::catalogue::catalogue;
use crate::output;
use crate::{signals, terminal};
use engine::replay::{Found, Replay, ReplayError, Request};
use engine::run::{Ending, Options, Wait};

/// Run one participant of a recorded run again, with the inputs it had then, and compare what it says with the tape.
///
/// It starts at the beginning, because only there its state is known. Exit code 0: identical. 3: different. 2: the
/// participant or the tape does not fit. 1: the participant failed.
#[derive(Debug, Args)]
pub struct ReplayArgs {
    /// The folder of a run
    pub run: PathBuf,
    /// Who is run again
    #[arg(long, short)]
    pub participant: String,
    /// This program in its place, with the arguments behind `--`
    #[arg(long, value_name = "PATH")]
    pub exe: Option<PathBuf>,
    /// In a process of its own over shared memory, as in the run; without it a participant that this program contains
    /// runs in this process
    #[arg(long)]
    pub process: bool,
    /// Change a key of the plan, such as participants.controller.parameters.law=\"reference\" (may be given more than once)
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// Replay only what happens before this simulated time
    #[arg(long, value_name = "TIME", value_parser = span)]
    pub to: Option<Rational>,
    /// Come to rest before the first step, or at this simulated time, say the process number, and wait for Enter
    #[arg(long, value_name = "TIME", num_args = 0..=1, default_missing_value = "0 s", require_equals = true, value_parser = instant)]
    pub wait_for_debugger: Option<Rational>,
    /// What every run takes
    #[command(flatten)]
    pub common: CommonArgs,
    /// Whether a damaged tape is replayed
    #[command(flatten)]
    pub trust: Trust,
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
                ReplayError::Tape(of_tape) => eprintln!("error: {}", told(of_tape)),
                other => eprintln!("error: {other}"),
            }
            Ok(error.exit_code())
        }
    }
}

fn replay(args: &ReplayArgs) -> Result<Found, ReplayError> {
    args.common.spares(&args.run).map_err(ReplayError::Misfit)?;
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
        unverified: args.trust.unverified,
    })?;
    if let Some(at) = args.wait_for_debugger.filter(|at| *at >= replay.end()) {
        return Err(ReplayError::Misfit(format!(
            "--wait-for-debugger {at}: the replay ends at t = {}: give an earlier time",
            replay.end()
        )));
    }
    let in_process = !args.process && !replay.external();
    if in_process && args.common.json {
        output::keep_apart();
    }
    if in_process {
        args.common
            .patience_in_process()
            .iter()
            .for_each(|words| eprintln!("warning: {words}"));
    }
    replay.run(&Options {
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
    })
}

fn report(args: &ReplayArgs, found: &Found) -> anyhow::Result<i32> {
    for note in &found.notes {
        eprintln!("note: {note}");
    }
    super::run::tell(&found.ending);
    let failed = found.ending != Ending::Complete;
    let mut out = output::stdout();
    if args.common.json {
        let result = json!({
            "participant": args.participant,
            "ending": found.ending,
            "to_s": found.to_s,
            "notes": found.notes,
            "comparison": found.comparison,
        });
        serde_json::to_writer_pretty(&mut out, &result)?;
        writeln!(out)?;
    } else if !args.common.quiet {
        writeln!(
            out,
            "`{}` of {} (A) and again (B), up to t = {} s:",
            args.participant,
            args.run.display(),
            found.to_s
        )?;
        print(&mut out, &found.comparison)?;
    }
    Ok(match (failed, found.comparison.identical) {
        (true, _) => 1,
        (false, true) => 0,
        (false, false) => DIFFERENT,
    })
}
