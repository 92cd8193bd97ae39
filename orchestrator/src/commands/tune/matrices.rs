//! Tuning of a static output feedback for a plant given as plain matrices.

use std::io::Write as _;
use std::sync::atomic::AtomicBool;

use synthesis::linalg::to_rows;
use synthesis::matrices::PlantMatrices;
use synthesis::robot::export;
use synthesis::state_space::ModelError;
use synthesis::tuner::{Options, Problem, Tuned, Verdict, tune};

use super::arguments::{NOT_MET, REFUSED, TuneArgs, failure};
use super::progress::progress_line;
use crate::commands::gains::{Reporter, finite, write};

/// Reads the matrices; an error starts with the line of its key.
fn read(text: &str) -> Result<Problem, String> {
    let at = |line: Option<usize>, message: String| match line {
        Some(line) => format!("{line}: {message}"),
        None => format!(" {message}"),
    };
    let line_of = |key: &str| {
        let quoted = format!("\"{key}\"");
        text.lines().position(|line| line.contains(&quoted)).map(|n| n + 1)
    };
    let plant: PlantMatrices = serde_json::from_str(text).map_err(|error| {
        let message = error.to_string();
        // The message of an error in a key, rather than in the syntax, starts with the key.
        let line = match error.line() {
            0 => message.split(':').next().and_then(line_of),
            line => Some(line),
        };
        at(line, message)
    })?;
    plant.static_output_feedback().map_err(|error| {
        let line = match &error {
            ModelError::Shape { name, .. } => line_of(name),
            _ => None,
        };
        at(line, error.to_string())
    })
}

/// Tunes and prints; returns the exit code.
pub(super) fn tune_matrices(args: &TuneArgs, text: &str, stop: &AtomicBool) -> anyhow::Result<i32> {
    let problem = match read(text) {
        Ok(problem) => problem,
        Err(error) => {
            eprintln!("error: {}:{error}", args.spec.display());
            return Ok(REFUSED);
        }
    };
    let options = Options {
        starts: args.starts.unwrap_or(8),
        seed: args.seed.unwrap_or(1),
        ..Options::default()
    };
    let reporter = Reporter::new(stop);
    let tuned = tune(&problem, &options, &|p| {
        reporter.show(|| progress_line(p, options.starts))
    });
    reporter.finish();
    let tuned = match tuned {
        Ok(tuned) => tuned,
        Err(error) => {
            eprintln!("error: {}: {error}", args.spec.display());
            return Ok(failure(&error));
        }
    };
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
    let starts: Vec<serde_json::Value> = tuned.starts.iter().map(|gamma| finite(*gamma)).collect();
    let result = serde_json::json!({
        "problem": problem.models[0].name,
        "gamma": tuned.evaluation.gamma,
        "peak_rad_s": finite(peak),
        "spectral_abscissa": tuned.evaluation.abscissa,
        "certificate": { "length": tuned.certificate.length, "radius": tuned.certificate.radius, "gradients": tuned.certificate.gradients },
        "K": to_rows(&tuned.controllers[0]),
        "attained": tuned.verdict == Verdict::Attained,
        "verdict": tuned.verdict.to_string(),
        "starts": starts,
        "stopped": tuned.stopped,
    });
    if let Some(path) = &args.out {
        write(path, &serde_json::to_string_pretty(&result)?)?;
    }
    let code = if tuned.verdict == Verdict::Attained {
        0
    } else {
        eprintln!("warning: {}: {}", args.spec.display(), tuned.verdict);
        NOT_MET
    };
    if args.json {
        writeln!(crate::output::stdout(), "{}", serde_json::to_string_pretty(&result)?)?;
    } else {
        print(&tuned, peak)?;
    }
    Ok(code)
}

/// The result as text.
fn print(tuned: &Tuned, peak: f64) -> anyhow::Result<()> {
    let mut out = crate::output::stdout();
    writeln!(
        out,
        "gamma              {:.8} at {peak:.6} rad/s",
        tuned.evaluation.gamma
    )?;
    writeln!(out, "spectral abscissa  {:.6e}", tuned.evaluation.abscissa)?;
    if tuned.certificate.gradients == 0 {
        writeln!(out, "certificate        none: ln gamma has no gradient here")?;
    } else {
        writeln!(
            out,
            "certificate        {:.2e} (least convex combination of {} gradients of ln gamma within {:.0e}; the steepest is {:.2e})",
            tuned.certificate.length, tuned.certificate.gradients, tuned.certificate.radius, tuned.certificate.steepest
        )?;
    }
    let starts: Vec<String> = tuned.starts.iter().map(|gamma| format!("{gamma:.6}")).collect();
    writeln!(
        out,
        "starts             {}{}",
        starts.join(" "),
        if tuned.stopped { " (stopped)" } else { "" }
    )?;
    for row in to_rows(&tuned.controllers[0]) {
        let row: Vec<String> = row.iter().map(|x| format!("{x:14.8}")).collect();
        writeln!(out, "K                  {}", row.join(" "))?;
    }
    Ok(())
}
