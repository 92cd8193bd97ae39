//! `escapement resume RUN`

use crate::program::catalogue;
use tape::Reader;
use tape::folder::RunFolder;

use super::run::execute;
use crate::cli::ResumeArgs;
use engine::run::Origin;
use engine::run::checkpoint::Checkpoint;
use engine::scenario::Scenario;

/// Goes on with a run in a folder of its own; the other one stays as it is.
pub fn run(args: &ResumeArgs) -> anyhow::Result<i32> {
    let folder = RunFolder::open(&args.run);
    if !folder.plan().is_file() {
        eprintln!(
            "error: {} is not the folder of a run: there is no plan.toml in it",
            args.run.display()
        );
        return Ok(2);
    }
    let checkpoint = match Checkpoint::find(&folder.checkpoints(), args.from) {
        Ok(checkpoint) => checkpoint,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(2);
        }
    };
    if let Err(reason) = args.how.common.spares(&args.run) {
        eprintln!("error: {reason}");
        return Ok(2);
    }
    let mut overrides = args.set.clone();
    overrides.extend(args.duration.map(|duration| format!("duration={duration}")));
    let mut scenario = match Scenario::read(catalogue(), &folder.plan(), &overrides) {
        Ok(scenario) => scenario,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(2);
        }
    };
    // What is on the tape is copied and sealed anew. A run that was killed has no seal; a tape that cannot be read is told later.
    if let Ok(tape) = Reader::open(&folder.tape())
        && let Err(error) = tape.verify()
    {
        eprintln!("error: the run cannot be taken up: {error}");
        return Ok(2);
    }
    if let Some(name) = name(&folder) {
        scenario.name = name;
    }
    if !args.how.common.quiet {
        eprintln!("going on from the checkpoint at t = {}", checkpoint.time);
    }
    let run = args.run.clone();
    execute(&scenario, &args.how, Some(Origin { run, checkpoint }), &[])
}

/// The name of the scenario that was run.
fn name(folder: &RunFolder) -> Option<String> {
    let text = std::fs::read_to_string(folder.run()).ok()?;
    let about: serde_json::Value = serde_json::from_str(&text).ok()?;
    Some(about.get("scenario")?.as_str()?.to_owned())
}
