//! Tuning of a static output feedback for a plant given as plain matrices.

use std::io::Write as _;
use std::sync::Mutex;
use std::sync::atomic::AtomicBool;

use synthesis::linalg::to_rows;
use synthesis::matrices::PlantMatrices;
use synthesis::robot::export;
use synthesis::tuner::{Options, tune};

use super::{REFUSED, Reporter, TuneArgs, failure, progress_line, write};

/// Tunes, prints; gives the exit code.
pub(super) fn tune_matrices(args: &TuneArgs, text: &str, stop: &AtomicBool) -> anyhow::Result<i32> {
    let problem = serde_json::from_str::<PlantMatrices>(text)
        .map_err(|e| e.to_string())
        .and_then(|plant| plant.static_output_feedback().map_err(|e| e.to_string()));
    let problem = match problem {
        Ok(problem) => problem,
        Err(error) => {
            eprintln!("error: {}: {error}", args.spec.display());
            return Ok(REFUSED);
        }
    };
    let options = Options {
        starts: args.starts.unwrap_or(8),
        seed: args.seed.unwrap_or(1),
        ..Options::default()
    };
    let reporter = Reporter {
        stop,
        last: Mutex::new(None),
    };
    let tuned = match tune(&problem, &options, &|p| reporter.say(|| progress_line(p))) {
        Ok(tuned) => tuned,
        Err(error) => {
            eprintln!("error: {}: {error}", args.spec.display());
            return Ok(failure(&error));
        }
    };
    let k = to_rows(&tuned.controllers[0]);
    if let Some(path) = &args.export_problem {
        let exported = export(
            &problem,
            &tuned.gains,
            &tuned.controllers,
            &tuned.evaluation,
            Some(&tuned.certificate),
        );
        write(path, &serde_json::to_string_pretty(&exported)?)?;
    }
    let peak = tuned.evaluation.channels.first().map_or(0.0, |c| c.omega);
    let starts: Vec<String> = tuned.starts.iter().map(|g| format!("{g:.6}")).collect();
    let result = serde_json::json!({
        "problem": problem.models[0].name,
        "gamma": tuned.evaluation.gamma,
        "peak_rad_s": if peak.is_finite() { peak } else { f64::MAX },
        "spectral_abscissa": tuned.evaluation.abscissa,
        "certificate": { "length": tuned.certificate.length, "radius": tuned.certificate.radius, "gradients": tuned.certificate.gradients },
        "K": k,
        "starts": starts,
        "stopped": tuned.stopped,
    });
    if let Some(path) = &args.out {
        write(path, &serde_json::to_string_pretty(&result)?)?;
    }
    let mut out = crate::output::stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&result)?)?;
        return Ok(0);
    }
    writeln!(
        out,
        "gamma              {:.8} at {peak:.6} rad/s",
        tuned.evaluation.gamma
    )?;
    writeln!(out, "spectral abscissa  {:.6e}", tuned.evaluation.abscissa)?;
    writeln!(
        out,
        "certificate        {:.2e} (least convex combination of {} gradients of ln gamma within {:.0e}; the steepest is {:.2e})",
        tuned.certificate.length, tuned.certificate.gradients, tuned.certificate.radius, tuned.certificate.steepest
    )?;
    writeln!(
        out,
        "starts             {}{}",
        starts.join(" "),
        if tuned.stopped { " (stopped)" } else { "" }
    )?;
    for row in &k {
        let row: Vec<String> = row.iter().map(|x| format!("{x:14.8}")).collect();
        writeln!(out, "K                  {}", row.join(" "))?;
    }
    Ok(0)
}
