//! A campaign whose workers and orchestrator receive signals: repeating the command completes it, with the table of an undisturbed one.

use std::path::Path;
use std::time::Duration;

use super::inspect::ensure_nothing_left;
use super::signals::{
    Action, Moment, ProcessNames, Running, ScheduledSignal, TapeProgress, Target, ensure_no_process_left,
};
use super::{Case, CheckResult, Rng, Tally, ensure, ensure_equal};
use crate::program::Folder;
use rustix::process::Signal;

const TABLES: [&str; 2] = ["table.csv", "table.parquet"];
/// Points of the campaign.
const POINTS: u64 = 8;

fn tables(folder: &Path) -> CheckResult<Vec<Vec<u8>>> {
    let read = |name: &&str| std::fs::read(folder.join(name)).map_err(|error| format!("{name}: {error}"));
    TABLES.iter().map(read).collect()
}

/// Round `number` of `seed`.
pub(super) fn run(seed: u64, number: u64, tally: &mut Tally) -> CheckResult<()> {
    let mut rng = Rng::new(seed, &format!("campaign {number}"));
    let folder = Folder::new("campaign");
    // A pair of programs, or the stock capture in one process.
    let case = Case::random(seed, if rng.one_in(2) { 0 } else { 5 }, true);
    let token = format!("campaign-{seed}-{number}-{}", std::process::id());
    let mut description = String::new();
    let result = execute(&mut rng, &case, &folder, &token, &mut description, tally);
    result.map_err(|reason| format!("{reason}\n  {description}\n  kept in {}", folder.keep().display()))
}

fn execute(
    rng: &mut Rng,
    case: &Case,
    folder: &Folder,
    token: &str,
    description: &mut String,
    tally: &mut Tally,
) -> CheckResult<()> {
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
    ensure(ended.code == Some(0), || {
        format!("the undisturbed campaign failed: {ended:?}")
    })?;
    ensure_no_process_left(token, Duration::ZERO)?;
    ensure_nothing_left(&scratch, false)?;

    let (arguments, out) = command("campaign");
    let scheduled_signals: Vec<ScheduledSignal> = (0..rng.between(1, 3)).map(|_| random_signal(rng)).collect();
    *description = format!("{scheduled_signals:?}");
    let progress = TapeProgress {
        stream: out.join("results.jsonl"),
        whole: std::fs::metadata(undisturbed.join("results.jsonl")).map_or(1, |about| about.len()),
        before: 0,
    };
    tally.runs += 1;
    let mut running = Running::start(&arguments, folder.path(), token);
    let mut delivered = Vec::new();
    for scheduled in &scheduled_signals {
        delivered.extend(running.deliver(scheduled, &ProcessNames::Workers, &out, &progress));
    }
    tally.signals += running.signals;
    let ended = running.finish()?;
    let sudden = delivered.iter().any(|one| matches!(one.action, Action::Signal(_)));
    ensure_no_process_left(token, Duration::from_secs(if sudden { 30 } else { 0 }))?;
    ensure_nothing_left(&scratch, sudden)?;
    ensure(sudden || ended.code == Some(0), || {
        format!("a healthy campaign failed: {ended:?}")
    })?;
    ensure(!ended.err.contains("panicked at"), || format!("a panic: {ended:?}"))?;
    if ended.code != Some(0) {
        tally.runs += 1;
        tally.resumes += 1;
        let again = Running::start(&arguments, folder.path(), token).finish()?;
        ensure(again.code == Some(0), || {
            format!("the same command does not complete it: {again:?}")
        })?;
        ensure_no_process_left(token, Duration::ZERO)?;
        ensure_nothing_left(&scratch, false)?;
    }
    let (found, right) = (tables(&out)?, tables(&undisturbed)?);
    for ((found, right), name) in found.iter().zip(&right).zip(TABLES) {
        ensure_equal(
            &format!("whether {name} is that of the undisturbed campaign"),
            &(found == right),
            &true,
        )?;
    }
    Ok(())
}

fn random_signal(rng: &mut Rng) -> ScheduledSignal {
    let us = rng.below(60_000);
    let moment = if rng.one_in(2) {
        Moment::After { us }
    } else {
        Moment::Tape {
            per_mille: rng.below(1000),
            us,
        }
    };
    let target = if rng.one_in(2) {
        Target::Orchestrator
    } else {
        Target::One(rng.below(2) as usize)
    };
    let action = match (rng.below(3), target) {
        (0, _) => Action::Pause {
            ms: rng.between(1, 300),
        },
        (_, Target::Orchestrator) => Action::Signal(rng.choose(&[Signal::KILL, Signal::TERM, Signal::INT])),
        _ => Action::Signal(rng.choose(&[Signal::KILL, Signal::ABORT, Signal::TERM])),
    };
    ScheduledSignal { moment, target, action }
}
