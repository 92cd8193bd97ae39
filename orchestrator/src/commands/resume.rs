//! `escapement resume RUN`: continues a run from a checkpoint, in a folder of its own.

use crate::catalogue::catalogue;
use std::path::PathBuf;

use clap::Args;
use lockstep::time::Rational;
use tape::Reader;
use tape::folder::RunFolder;

use super::run::{execute, options};
use crate::arguments::{ExecutionArgs, parse_duration, parse_instant};
use engine::run::checkpoint::Checkpoint;
use engine::run::{Origin, RunFailure, branch, check, check_branch};
use engine::scenario::{Changes, Scenario, Time};

/// Arguments of `resume`.
#[derive(Debug, Args)]
pub struct ResumeArgs {
    /// The folder of the run to continue
    pub run: PathBuf,
    /// Continue from the newest checkpoint at or before this simulated time, and apply the changes at this time; by default from the newest
    /// checkpoint
    #[arg(long, value_name = "TIME", value_parser = parse_instant)]
    pub from: Option<Rational>,
    /// Change a key of the scenario from then on (may be given more than once)
    #[arg(long = "set", value_name = "KEY.PATH=VALUE")]
    pub set: Vec<String>,
    /// The simulated duration from the start of the first run, instead of the one that it had
    #[arg(long, value_parser = parse_duration)]
    pub duration: Option<Rational>,
    /// How to run it
    #[command(flatten)]
    pub execution: ExecutionArgs,
}

/// Continues a run in a new folder; the original one is not changed.
pub fn run(args: &ResumeArgs) -> anyhow::Result<i32> {
    args.execution.check_trace()?;
    let folder = RunFolder::open(&args.run);
    let refused = match tape::is_file(&folder.plan()) {
        Ok(true) => None,
        Ok(false) => Some(format!(
            "{} is not the folder of a run: there is no plan.toml in it",
            args.run.display()
        )),
        Err(error) => Some(error.to_string()),
    };
    if let Some(reason) = refused {
        eprintln!("error: {reason}");
        return Ok(2);
    }
    let (checkpoint, left_out) = match Checkpoint::find(&folder.checkpoints(), args.from) {
        Ok(found) => found,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(2);
        }
    };
    for error in left_out {
        eprintln!("warning: {error}; the file is left out");
    }
    if let Err(reason) = args.execution.common.check_does_not_replace(&args.run) {
        eprintln!("error: {reason}");
        return Ok(2);
    }
    let read = |set: &[String]| {
        let duration = args.duration.map(Time::from);
        let changes = Changes { duration, ..set.into() };
        Scenario::changed(catalogue(), &folder.plan(), &changes)
    };
    let read = read(&args.set).and_then(|scenario| Ok((scenario, read(&[])?)));
    let (mut scenario, unchanged) = match read {
        Ok(both) => both,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(2);
        }
    };
    // The content of the tape is copied and sealed again. A run that was killed has no seal; a tape that cannot be read is
    // reported later.
    if let Ok(tape) = Reader::open(&folder.tape())
        && let Err(error) = tape.verify()
    {
        eprintln!("error: the run cannot be resumed: {error}");
        return Ok(2);
    }
    if let Some(name) = folder.scenario_name() {
        scenario.name = name;
    }
    // Without changes the result is the same from any checkpoint.
    let at = args.from.filter(|at| !args.set.is_empty() && *at > checkpoint.time);
    if !args.execution.common.quiet {
        for warning in catalogue().change_warnings(&scenario, &unchanged) {
            eprintln!("warning: {warning}");
        }
        print_start(checkpoint.time, at);
    }
    let run = args.run.clone();
    let origin = Origin { run, checkpoint };
    let Some(at) = at else {
        return execute(&scenario, &args.execution, Some(origin), &[]);
    };
    // Errors at the time of the changes are reported before the run.
    let checked = check(&scenario).map_err(RunFailure::from);
    let checked = checked.and_then(|_| check_branch(&scenario, &unchanged, at));
    match checked.and_then(|()| branch(&unchanged, &options(&args.execution), origin, at)) {
        Ok(branch) => execute(&scenario, &args.execution, Some(branch.origin.clone()), &[]),
        Err(failure) => {
            eprintln!("error: {failure}");
            Ok(failure.exit_code())
        }
    }
}

fn print_start(checkpoint: Rational, changed_at: Option<Rational>) {
    let and = changed_at.map(|at| format!(", with changes from t = {at} on"));
    eprintln!(
        "continuing from the checkpoint at t = {checkpoint}{}",
        and.unwrap_or_default()
    );
}
