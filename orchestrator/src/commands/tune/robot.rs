//! Tuning of the gains of a robot's velocity loop.

use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use synthesis::robot::{Step, ValidateError, design, export};

use super::arguments::{NOT_MET, REFUSED, TuneArgs, failure};
use super::print::print;
use super::progress::progress_line;
use super::verify::verify;
use crate::commands::gains::{
    Reporter, files_of, load, look_up, override_with, sliding_gain, take_sliding_gain, threads, write,
};
use crate::destination;
use capture::provenance::{digest, plant_digest};

/// Tunes, verifies, writes; returns the exit code.
pub fn tune_robot(args: &TuneArgs, text: &str, stop: &AtomicBool) -> anyhow::Result<i32> {
    let loaded = load(&args.spec, text, args.allow_unphysical).and_then(|(mut spec, robot, urdf)| {
        override_with(&mut spec, &args.at)?;
        look_up(&args.spec, &mut spec)?;
        let proportional = sliding_gain(&args.spec, &spec, &urdf)?;
        anyhow::Ok((spec, robot, urdf, proportional))
    });
    let (mut spec, robot, urdf, proportional) = match loaded {
        Ok(loaded) => loaded,
        Err(error) => {
            eprintln!("error: {}: {error:#}", args.spec.display());
            return Ok(REFUSED);
        }
    };
    let path = args.gains_path().unwrap_or_default();
    let named = files_of(&args.spec, &spec);
    let named: Vec<(&str, &Path)> = named.iter().map(|(key, file)| (*key, file.as_path())).collect();
    destination::check_distinct(&named, &args.destinations(Some(&path)))?;
    spec.search.starts = args.starts.unwrap_or(spec.search.starts);
    spec.search.seed = args.seed.unwrap_or(spec.search.seed);
    let reporter = Reporter::new(stop);
    let clock = Instant::now();
    let design = match design(&spec, &robot, threads(), &|step| {
        reporter.show(|| match step {
            Step::Tune(p) => progress_line(p, spec.search.starts),
            Step::Validate(done) => format!("validating: {done} of {}", spec.validation.samples),
            Step::Adversary(gamma) => format!("the adversary adds a situation with gamma {gamma:.3}"),
        })
    }) {
        Ok(design) => design,
        Err(error) => {
            reporter.finish();
            eprintln!("error: {}: {error}", args.spec.display());
            return Ok(match &error {
                ValidateError::Tune(error) => failure(error),
                ValidateError::Robot(_) => REFUSED,
            });
        }
    };
    reporter.finish();
    let tuning = clock.elapsed().as_secs_f64();
    if let Some(path) = &args.export_problem {
        let d = &design;
        let exported = export(
            &d.problem,
            &d.tuned.gains,
            &d.tuned.controllers,
            &d.tuned.evaluation,
            Some(&d.tuned.certificate),
        );
        write(path, &serde_json::to_string(&exported)?)?;
    }
    let (mut file, mut unmet) = verify(args, &spec, &robot, &design, &reporter)?;
    file.provenance.specification = args.spec.display().to_string();
    file.provenance.specification_digest = digest(text);
    file.provenance.plant_digest = plant_digest(&urdf).unwrap_or_default();
    if let Some(proportional) = &proportional {
        take_sliding_gain(&mut file, &spec, proportional);
    }
    if design.tuned.stopped {
        unmet.push("the search was stopped before it was done".into());
    }
    write(&path, &toml::to_string(&file)?)?;
    print(args, &spec, &file, tuning)?;
    for reason in &unmet {
        eprintln!("not met: {reason}");
    }
    eprintln!("gains written to {}", path.display());
    Ok(if unmet.is_empty() { 0 } else { NOT_MET })
}
