//! A scenario without a file: built in code, run in this process and in separate processes with the same tape, changed, and run again.

use std::path::Path;
use std::process::ExitCode;

use escapement::prelude::*;
use from_code::{Gains, catalogue, contents, options};

fn main() -> ExitCode {
    // The process of a participant is this program, started with a command line.
    if std::env::args_os().len() > 1 {
        return Program::new("without_file").contents(contents).main();
    }
    match runs() {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

fn tank_and_pump() -> Result<ScenarioSpec, Box<dyn std::error::Error>> {
    let gains = Gains { wanted: 1.0, gain: 0.2 };
    let tank = ParticipantSpec::builtin("tank")
        .every("50 ms")
        .parameter("depth", 0.4)
        .parameter("leak", 0.002);
    Ok(ScenarioSpec::new("60 s")
        .title("A tank that leaks, and its pump")
        .participant("tank", tank)
        .participant(
            "pump",
            ParticipantSpec::builtin("pump").every("1 s").parameters(&gains)?,
        )
        .connection("level", ConnectionSpec::new("tank.level", "pump.level").delay("100 ms"))
        .connection("flow", ConnectionSpec::new("pump.flow", "tank.pump"))
        .guard("full", GuardSpec::new("tank.level").field("depth").range("[0, 2] m"))
        .measure(
            "filled",
            MeasureSpec::new("tank.level.depth", MeasureKind::Final).at_least("80 cm"),
        ))
}

fn runs() -> Result<(), Box<dyn std::error::Error>> {
    let mut spec = tank_and_pump()?;
    let run = |spec: &ScenarioSpec, options: &Options| -> Result<String, Box<dyn std::error::Error>> {
        let scenario = Scenario::of(&catalogue(), spec.clone(), Path::new("tank.toml"))?;
        let outcome = escapement::run(&scenario, options)?;
        let digest = outcome.digest.map_or("none".into(), |digest| digest.to_string());
        let figures = outcome.figures.map_or(String::new(), |figures| figures.text());
        println!("{:?}, tape {digest}\n{figures}", outcome.ending);
        Ok(digest)
    };
    let folder = std::env::temp_dir().join(format!("without-file-{}", std::process::id()));
    let processes = Options {
        out: Some(folder.clone()),
        ..Options::default()
    };
    let here = run(&spec, &options())?;
    let apart = run(&spec, &processes);
    let plan = std::fs::read_to_string(folder.join("plan.toml"));
    let _ = std::fs::remove_dir_all(&folder);
    println!("the same tape in processes: {}", here == apart?);
    println!("plan.toml has {} lines", plan?.lines().count());

    // A change sets a field, or a key that a participant defines.
    spec.participants["pump"].period = "5 s".into();
    spec.set("participants.pump.parameters.gain", 0.02)?;
    run(&spec, &options())?;
    Ok(())
}
