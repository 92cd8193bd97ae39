//! Closed-loop verification of tuned gains in the non-linear simulator: sloshing propellant, saturating actuators and
//! delays, over configurations and delays. The result of the linear analysis of the same loop is reported with each run.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::{Context, bail};
use engine::Catalogue;
use engine::run::{Ending, Options, run};
use engine::scenario::{Scenario, ScenarioSpec};
use engine::scope::Scope;
use lockstep::time::Rational;
use synthesis::robot::{ClosedLoopEntry, ClosedLoopSpec, GainTable, Gains, ModelSpec, Robot, Spec, spectral_radius};
use toml::{Table, Value};

/// Simulates the gains in every configuration and with every delay of the specification. Before each run `next` is called
/// with the number of completed runs and the total; it returns whether to stop.
///
/// # Errors
/// A scenario that is missing or invalid, or a participant that fails for another reason than a diverging loop.
pub fn simulate_gains(
    catalogue: &Arc<Catalogue>,
    specification: &Path,
    spec: &Spec,
    robot: &Robot,
    gains: &Gains,
    next: &dyn Fn(usize, usize) -> bool,
) -> anyhow::Result<Vec<ClosedLoopEntry>> {
    let Some(verification) = &spec.closed_loop else {
        return Ok(Vec::new());
    };
    let scenario = find_beside_specification(specification, &verification.scenario).with_context(|| {
        format!(
            "closed_loop.scenario = {:?}: no such file here, beside the specification, or above it",
            verification.scenario
        )
    })?;
    // In a folder that the next run or `doctor` clears if this program is killed.
    let scope = Scope::create()?;
    let folder = scope.scratch()?.join("closed-loop");
    let base_scenario = ScenarioSpec::read(&scenario, &[])?;
    let mut entries = Vec::new();
    // A payload is a body that the simulator has only after a grasp.
    let models: Vec<&ModelSpec> = spec.models.iter().filter(|model| model.payload.is_none()).collect();
    let count = models.len() * verification.delays_s.len();
    for model in models {
        for &delay in &verification.delays_s {
            if next(entries.len(), count) {
                return Ok(entries);
            }
            let mut configured = base_scenario.clone();
            apply_configuration(&mut configured, verification, gains, model, delay)?;
            let read = Scenario::of(catalogue, configured, &scenario)?;
            let options = Options {
                in_process: true,
                out: Some(folder.clone()),
                ..Options::default()
            };
            let ended = run(&read, &options);
            // The folder is removed whatever the outcome of the run.
            let removed = std::fs::remove_dir_all(&folder);
            let outcome = ended?;
            removed.with_context(|| folder.display().to_string())?;
            let figures = outcome.figures.as_ref();
            let settled = match &outcome.ending {
                Ending::Stopped { .. } => return Ok(entries),
                // A diverging loop ends in values that are not finite, which the participants reject.
                Ending::Failed { .. } => false,
                Ending::Complete => figures.is_some_and(engine::assessment::Figures::met),
            };
            entries.push(ClosedLoopEntry {
                model: model.name.clone(),
                delay_s: delay,
                spectral_radius: linear_spectral_radius(spec, robot, gains, model, delay)?,
                settled,
                saturated_fraction: figures
                    .and_then(|figures| figures.number("saturated_fraction"))
                    .unwrap_or(1.0),
            });
        }
    }
    Ok(entries)
}

/// The result of the linear analysis of the simulated loop: nominal masses, sloshing propellant, these delays.
fn linear_spectral_radius(
    spec: &Spec,
    robot: &Robot,
    gains: &Gains,
    model: &ModelSpec,
    delay: f64,
) -> anyhow::Result<f64> {
    let mut delayed = spec.clone();
    delayed.sampling.sensor_delay_s = delay;
    delayed.sampling.actuator_delay_s = delay;
    delayed.sampling.computing_s = 0.0;
    delayed.sampling.actuator_lag_s = 0.0;
    let mut nominal = ModelSpec::nominal(model.joints_deg.clone());
    nominal.slosh = true;
    Ok(spectral_radius(&delayed, robot, &nominal, gains)?)
}

/// Sets these gains, this configuration and this delay in the scenario.
fn apply_configuration(
    spec: &mut ScenarioSpec,
    verification: &ClosedLoopSpec,
    gains: &Gains,
    model: &ModelSpec,
    delay: f64,
) -> anyhow::Result<()> {
    if !(delay.is_finite() && delay >= 0.0) {
        bail!("closed_loop.delays_s has {delay}: a delay must be zero or positive");
    }
    let table = Table::from_iter([("gains".to_owned(), Value::try_from(GainTable::new(gains))?)]);
    let joints: Vec<String> = model.joints_deg.iter().map(ToString::to_string).collect();
    spec.set(&verification.gains_key, table)?;
    spec.set(&verification.joints_key, format!("[{}] deg", joints.join(", ")))?;
    for key in &verification.delay_keys {
        spec.set(key, format!("{:.6} ms", 1e3 * delay))?;
    }
    if gains.ki.is_empty() {
        spec.change(&verification.proportional)?;
    }
    Ok(())
}

/// Finds a file or folder that a specification names: relative to the working directory, to the specification's folder, or
/// to its parent.
pub fn find_beside_specification(specification: &Path, named: &str) -> Option<PathBuf> {
    let folder_of_specification = specification.parent().unwrap_or(Path::new("."));
    [
        PathBuf::from(named),
        folder_of_specification.join(named),
        folder_of_specification.join("..").join(named),
    ]
    .into_iter()
    .find(|path| path.exists())
}

/// Runs a scenario to this instant in this process, and calls `read` with the run's folder before it is removed.
///
/// # Errors
/// A scenario that is invalid or does not reach the instant, and any error of `read`.
pub fn record_run<T>(
    catalogue: &Arc<Catalogue>,
    scenario: &Path,
    until: Rational,
    read: impl FnOnce(&Path) -> anyhow::Result<T>,
) -> anyhow::Result<T> {
    let duration = if until.is_positive() {
        until
    } else {
        Rational::from_millis(1)
    };
    let mut spec = ScenarioSpec::read(scenario, &[])?;
    spec.duration = duration.into();
    let scenario = Scenario::of(catalogue, spec, scenario)?;
    let scope = Scope::create()?;
    let folder = scope.scratch()?.join("record");
    let options = Options {
        in_process: true,
        out: Some(folder.clone()),
        ..Options::default()
    };
    let outcome = run(&scenario, &options)?;
    let found = match outcome.ending {
        Ending::Complete => read(&folder),
        _ => Err(anyhow::anyhow!("{}: the run does not get to {duration}", scenario.name)),
    };
    std::fs::remove_dir_all(&folder).with_context(|| folder.display().to_string())?;
    found
}
