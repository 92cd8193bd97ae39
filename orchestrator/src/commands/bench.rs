//! `escapement bench`: the cost of lockstep on this machine.

use crate::catalogue::catalogue;
use std::path::{Path, PathBuf};

use clap::Args;

use crate::bench::{self, Measurements};
use engine::run::{Options, Outcome, Wait, run as run_scenario};
use engine::scenario::{Scenario, ScenarioSpec};
use engine::scope::Scope;

/// Arguments of `bench`.
#[derive(Debug, Args)]
pub struct BenchArgs {
    /// Measure this scenario too, such as scenarios/close.toml
    pub scenario: Option<PathBuf>,
    /// The number of rounds in which each ratio is measured
    #[arg(long, default_value_t = 11)]
    pub rounds: usize,
    /// The number of participants in the largest ring
    #[arg(long, default_value_t = 64)]
    pub participants: usize,
    /// The number of participants that are killed, to measure how soon this is detected
    #[arg(long, default_value_t = 100)]
    pub deaths: usize,
}

/// Measures ratios and prints them.
pub fn run(args: &BenchArgs) -> anyhow::Result<i32> {
    let scope = Scope::create()?;
    measure(args, &scope.scratch()?)?;
    Ok(0)
}

fn measure(args: &BenchArgs, folder: &Path) -> anyhow::Result<()> {
    println!(
        "{} rounds of each, in turn; figures are 5th percentile, median and 95th percentile, ratios those of each round",
        args.rounds
    );
    exchange(args, folder)?;

    let sizes = bench::scaling(args.rounds.min(5), args.participants, |size, steps| {
        relay_step_s(folder, bench::ring(size, steps), steps, Wait::Auto)
    })?;
    println!("\none activation in a ring of N participants, ns");
    for (size, figures) in &sizes {
        row(&format!("N = {size}"), figures);
    }

    let ahead = bench::delay_benefit(args.rounds, |scenario, in_process| {
        worker_step_us(folder, scenario, in_process)
    })?;
    println!("\ntwo participants with 20 us of work a step that read each other ten steps late, us a step of both");
    row("in one loop", &ahead.looped);
    row("a process each", &ahead.processes);
    row("  one loop / a process each", &ahead.looped.ratios_to(&ahead.processes));

    if args.deaths > 0 {
        println!("\nfrom kill -9 of a participant to its detection, ms");
        let many = args.participants.max(2);
        for (name, size, pace, count) in [
            ("ring of 2, as fast as it can", 2, None, args.deaths),
            ("ring of 2, at the wall clock's pace", 2, Some(1.0), args.deaths),
            (
                &*format!("ring of {many}, at the wall clock's pace"),
                many,
                Some(1.0),
                args.deaths.div_ceil(10),
            ),
        ] {
            let figures = bench::death_detection_latency(count, &folder.join("run"), || {
                run_ring(folder, bench::ring(size, UNREACHED_STEPS), Wait::Auto, pace)
            })?;
            row(name, &figures);
            println!(
                "  {:<42} {:>32.1}",
                format!("  the slowest of {count}"),
                figures.percentile(100)
            );
        }
    }

    if let Some(path) = &args.scenario {
        let scenario = Scenario::read(catalogue(), path, &[])?;
        let share = bench::overhead(&scenario, args.rounds, folder)?;
        println!("\n{}, s of wall time", path.display());
        row("in one process, nothing recorded", &share.alone);
        row("in one process, recorded", &share.recorded);
        row("a process each, recorded", &share.processes);
        row("  recording: parts of that", &share.recorded.ratios_to(&share.alone));
        row(
            "  lockstep and recording: parts of that",
            &share.processes.ratios_to(&share.alone),
        );
        println!("\n{}, s of processor time of the thread that steps", path.display());
        row("in one process, everything computed", &share.own_computed);
        row("in one process, everything recorded", &share.own_recorded);
        row(
            "  recording: parts of that",
            &share.own_recorded.ratios_to(&share.own_computed),
        );
    }
    Ok(())
}

fn exchange(args: &BenchArgs, folder: &Path) -> anyhow::Result<()> {
    let all = bench::exchange(args.rounds, |steps, wait, recorded| {
        let ring = bench::ring(2, steps);
        relay_step_s(
            folder,
            if recorded { ring } else { bench::unrecorded(ring) },
            steps,
            wait,
        )
    })?;
    println!("\none exchange of 27 doubles each way between two processes, ns");
    row("lockstep, recording on", &all.lockstep);
    row("bare iceoryx2 publish-subscribe, polled", &all.bare);
    row("lockstep, nothing recorded", &all.unrecorded);
    row("bare rings of slots, polled, two threads", &all.rings);
    row("bare atomics, two threads", &all.atomics);
    row("  lockstep / bare iceoryx2", &all.lockstep.ratios_to(&all.bare));
    row(
        "  nothing recorded / bare rings of slots",
        &all.unrecorded.ratios_to(&all.rings),
    );
    row("  lockstep / bare atomics", &all.lockstep.ratios_to(&all.atomics));
    Ok(())
}

fn row(name: &str, figures: &Measurements) {
    let cell = |percent| {
        let figure = figures.percentile(percent);
        if figure < 10.0 {
            format!("{figure:10.4}")
        } else {
            format!("{figure:10.0}")
        }
    };
    println!("  {name:<42} {} {} {}", cell(5), cell(50), cell(95));
}

/// Runs the two workers for [`bench::STEPS`] steps; returns microseconds per step.
fn worker_step_us(folder: &Path, spec: &ScenarioSpec, in_process: bool) -> anyhow::Result<f64> {
    let scenario = Scenario::of(catalogue(), spec.clone(), &folder.join("ahead.toml"))?;
    let options = Options {
        out: Some(folder.join("run")),
        in_process,
        patience_s: 60.0,
        ..Options::default()
    };
    let outcome = run_scenario(&scenario, &options)?;
    outcome.folder.iter().try_for_each(std::fs::remove_dir_all)?;
    if outcome.ending != engine::run::Ending::Complete {
        anyhow::bail!("two that work did not run to their end: {:?}", outcome.ending);
    }
    Ok(1e6 * outcome.wall_s / bench::STEPS as f64)
}

/// More steps than a run ever reaches here.
const UNREACHED_STEPS: u64 = 1_000_000_000;

/// Runs a ring of relays for `steps` steps; returns seconds per step.
fn relay_step_s(folder: &Path, ring: ScenarioSpec, steps: u64, wait: Wait) -> anyhow::Result<f64> {
    let outcome = run_ring(folder, ring, wait, None)?;
    outcome.folder.iter().try_for_each(std::fs::remove_dir_all)?;
    if outcome.ending != engine::run::Ending::Complete {
        anyhow::bail!("a ring did not run to its end: {:?}", outcome.ending);
    }
    Ok(outcome.wall_s / steps as f64)
}

fn run_ring(folder: &Path, ring: ScenarioSpec, wait: Wait, pace: Option<f64>) -> anyhow::Result<Outcome> {
    let scenario = Scenario::of(catalogue(), ring, &folder.join("ring.toml"))?;
    let out = folder.join("run");
    let options = Options {
        out: Some(out),
        pace,
        wait,
        // If two participants spin, the scheduler migrates one of them when the recorder needs its core.
        no_placement: wait == Wait::Spin,
        patience_s: 60.0,
        ..Options::default()
    };
    Ok(run_scenario(&scenario, &options)?)
}
