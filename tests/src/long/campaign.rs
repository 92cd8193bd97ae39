//! A campaign whose workers and orchestrator receive signals: repeating the command completes it, with the table of an undisturbed one.

use std::path::Path;
use std::time::Duration;

use super::inspect::nothing_left;
use super::strike::{Action, Moment, Parts, Progress, Running, Strike, Target, none_left};
use super::{Case, Check, Dice, Tally, demand, equal};
use crate::program::Folder;
use rustix::process::Signal;

const TABLES: [&str; 2] = ["table.csv", "table.parquet"];
/// Points of the campaign.
const POINTS: u64 = 8;

fn tables(folder: &Path) -> Check<Vec<Vec<u8>>> {
    let read = |name: &&str| std::fs::read(folder.join(name)).map_err(|error| format!("{name}: {error}"));
    TABLES.iter().map(read).collect()
}

/// Round `number` of `seed`.
pub(super) fn run(seed: u64, number: u64, tally: &mut Tally) -> Check<()> {
    let mut dice = Dice::new(seed, &format!("campaign {number}"));
    let folder = Folder::new("campaign");
    // A pair of programs, or the stock capture in one process.
    let case = Case::draw(seed, if dice.one_in(2) { 0 } else { 5 }, true);
    let token = format!("campaign-{seed}-{number}-{}", std::process::id());
    let mut told = String::new();
    let result = play(&mut dice, &case, &folder, &token, &mut told, tally);
    result.map_err(|reason| format!("{reason}\n  {told}\n  kept in {}", folder.keep().display()))
}

fn play(dice: &mut Dice, case: &Case, folder: &Folder, token: &str, told: &mut String, tally: &mut Tally) -> Check<()> {
    let command = |name: &str| {
        let out = folder.path().join(name);
        let mut arguments = vec!["sweep".to_owned()];
        // The duration varies, so it does not apply to all points.
        arguments.extend(case.arguments(folder.path()).into_iter().take(1));
        let vary = format!(
            "duration={}",
            (1..=POINTS)
                .map(|n| format!("{}ms", 100 * n))
                .collect::<Vec<_>>()
                .join(",")
        );
        arguments.extend(["--vary".into(), vary, "--workers".into(), "2".into()]);
        arguments.extend(["--quiet".into(), "--out".into(), out.display().to_string()]);
        (arguments, out)
    };
    let scratch = folder.path().join("scratch");
    let (arguments, undisturbed) = command("undisturbed");
    tally.runs += 1;
    let ended = Running::start(&arguments, folder.path(), token).finish()?;
    demand(ended.code == Some(0), || {
        format!("the undisturbed campaign failed: {ended:?}")
    })?;
    none_left(token, Duration::ZERO)?;
    nothing_left(&scratch, false)?;

    let (arguments, out) = command("campaign");
    let strikes: Vec<Strike> = (0..dice.between(1, 3)).map(|_| strike(dice)).collect();
    *told = format!("{strikes:?}");
    let progress = Progress {
        stream: out.join("results.jsonl"),
        whole: std::fs::metadata(undisturbed.join("results.jsonl")).map_or(1, |about| about.len()),
        before: 0,
    };
    tally.runs += 1;
    let mut running = Running::start(&arguments, folder.path(), token);
    let mut hits = Vec::new();
    for strike in &strikes {
        hits.extend(running.deliver(strike, &Parts::Workers, &out, &progress));
    }
    tally.signals += running.signals;
    let ended = running.finish()?;
    let sudden = hits.iter().any(|hit| matches!(hit.action, Action::Signal(_)));
    none_left(
        token,
        if sudden {
            Duration::from_secs(30)
        } else {
            Duration::ZERO
        },
    )?;
    nothing_left(&scratch, sudden)?;
    demand(sudden || ended.code == Some(0), || {
        format!("a healthy campaign failed: {ended:?}")
    })?;
    demand(!ended.err.contains("panicked at"), || format!("a panic: {ended:?}"))?;
    if ended.code != Some(0) {
        tally.runs += 1;
        tally.resumes += 1;
        let again = Running::start(&arguments, folder.path(), token).finish()?;
        demand(again.code == Some(0), || {
            format!("the same command does not complete it: {again:?}")
        })?;
        none_left(token, Duration::ZERO)?;
        nothing_left(&scratch, false)?;
    }
    let (found, right) = (tables(&out)?, tables(&undisturbed)?);
    for ((found, right), name) in found.iter().zip(&right).zip(TABLES) {
        equal(
            &format!("whether {name} is that of the undisturbed campaign"),
            &(found == right),
            &true,
        )?;
    }
    Ok(())
}

fn strike(dice: &mut Dice) -> Strike {
    let us = dice.below(60_000);
    let moment = if dice.one_in(2) {
        Moment::After { us }
    } else {
        Moment::Tape {
            per_mille: dice.below(1000),
            us,
        }
    };
    let target = if dice.one_in(2) {
        Target::Orchestrator
    } else {
        Target::One(dice.below(2) as usize)
    };
    let action = match (dice.below(3), target) {
        (0, _) => Action::Pause {
            ms: dice.between(1, 300),
        },
        (_, Target::Orchestrator) => Action::Signal(dice.pick(&[Signal::KILL, Signal::TERM, Signal::INT])),
        _ => Action::Signal(dice.pick(&[Signal::KILL, Signal::ABORT, Signal::TERM])),
    };
    Strike { moment, target, action }
}
