//! Validation on random situations, and the adversary: a search for bad situations, which become additional models.

use std::sync::atomic::{AtomicUsize, Ordering};

use super::linearise::{Robot, RobotError};
use super::plant::{Gains, problem};
use super::sampled::sampled;
use super::spec::{ModelSpec, Spec};
use crate::parallel;
use crate::rng::Rng;
use crate::tuner::{TuneError, evaluate};

/// One random situation and the performance of the gains in it.
#[derive(Debug, Clone)]
pub struct Sample {
    /// The situation.
    pub model: ModelSpec,
    /// Its largest channel norm; infinite when the continuous loop is unstable.
    pub gamma: f64,
    /// Spectral radius of the sampled loop.
    pub spectral_radius: f64,
}

impl Sample {
    /// Whether the sampled loop is stable here.
    pub fn stable(&self) -> bool {
        self.spectral_radius < 1.0 && self.gamma.is_finite()
    }

    /// Ranking: unstable samples by spectral radius, the others by gamma.
    fn severity(&self) -> f64 {
        if self.stable() {
            self.gamma
        } else {
            1e6 * self.spectral_radius.max(1.0)
        }
    }
}

/// The result of a validation.
#[derive(Debug, Clone)]
pub struct Validation {
    /// All samples, the worst first.
    pub samples: Vec<Sample>,
    /// The largest gamma that passes.
    pub limit: f64,
}

impl Validation {
    /// Whether every sample is stable and below the limit.
    pub fn passed(&self) -> bool {
        self.samples.iter().all(|s| s.stable() && s.gamma <= self.limit)
    }

    /// Number of samples that are not stable.
    pub fn unstable(&self) -> usize {
        self.samples.iter().filter(|s| !s.stable()).count()
    }

    /// Number of stable samples above the limit.
    pub fn above(&self) -> usize {
        self.samples
            .iter()
            .filter(|s| s.stable() && s.gamma > self.limit)
            .count()
    }

    /// The largest gamma of the stable samples; zero when there is none.
    pub fn worst_gamma(&self) -> f64 {
        let stable = self.samples.iter().filter(|s| s.stable());
        stable.map(|s| s.gamma).fold(0.0, f64::max)
    }

    /// A histogram of gamma: edges of the bins (the last bin is open) and counts.
    pub fn histogram(&self) -> Vec<(f64, usize)> {
        let edges = [0.0, 0.8, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5, 1.75, 2.0, 3.0, 5.0];
        let mut bins: Vec<(f64, usize)> = edges.iter().map(|e| (*e, 0)).collect();
        for sample in &self.samples {
            let at = edges.iter().rposition(|e| sample.gamma >= *e).unwrap_or(0);
            bins[at].1 += 1;
        }
        bins
    }
}

/// Errors of running a validation.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ValidateError {
    /// An error of the robot or the specification.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// An inconsistent tuning problem.
    #[error(transparent)]
    Tune(#[from] TuneError),
}

/// A random situation of the validation set.
pub fn random_situation(spec: &Spec, index: u64) -> ModelSpec {
    let v = &spec.validation;
    let mut rng = Rng::new(v.seed, index);
    let mut symmetric = |range: f64| range * (2.0 * rng.uniform() - 1.0);
    let joints: Vec<f64> = v.joints_deg.iter().map(|r| symmetric(*r)).collect();
    let mut model = ModelSpec::nominal(joints);
    model.name = format!("sample {index}");
    model.base_mass = 1.0 + symmetric(v.mass);
    model.base_inertia = 1.0 + symmetric(v.mass);
    model.arm_inertia = 1.0 + symmetric(v.mass);
    model.fill = v.fill[0] + (v.fill[1] - v.fill[0]) * rng.uniform();
    model.extra_delay_s = v.extra_delay_s * rng.uniform();
    model
}

/// Assesses the gains in one situation.
///
/// # Errors
/// An impossible situation.
pub fn assess(
    spec: &Spec,
    robot: &Robot,
    model: &ModelSpec,
    gains: &Gains,
    order: usize,
) -> Result<Sample, ValidateError> {
    let mut one = spec.clone();
    one.models = vec![model.clone()];
    let gamma = evaluate(&problem(&one, robot, &[], order, Some(gains))?)?.gamma;
    let spectral_radius = super::sampled::spectral_radius(spec, robot, model, gains)?;
    Ok(Sample {
        model: model.clone(),
        gamma,
        spectral_radius,
    })
}

/// Assesses the gains on the whole validation set; `watch` receives the number of completed samples.
///
/// # Errors
/// An impossible specification.
pub fn validate(
    spec: &Spec,
    robot: &Robot,
    gains: &Gains,
    threads: usize,
    watch: &(dyn Fn(usize) + Sync),
) -> Result<Validation, ValidateError> {
    Ok(Validation {
        samples: evaluate_pool(spec, robot, gains, 0, threads, watch)?,
        limit: spec.validation.gamma,
    })
}

/// As many random situations as the validation set has, from index `first`, the worst first.
fn evaluate_pool(
    spec: &Spec,
    robot: &Robot,
    gains: &Gains,
    first: u64,
    threads: usize,
    watch: &(dyn Fn(usize) + Sync),
) -> Result<Vec<Sample>, ValidateError> {
    let done = AtomicUsize::new(0);
    let assessed = parallel::map(spec.validation.samples, threads, |index| {
        let model = random_situation(spec, first + index as u64);
        let sample = assess(spec, robot, &model, gains, spec.sampling.pade_order_tuning);
        watch(done.fetch_add(1, Ordering::Relaxed) + 1);
        sample
    });
    let mut samples = assessed.into_iter().collect::<Result<Vec<_>, _>>()?;
    samples.sort_by(|a, b| b.severity().total_cmp(&a.severity()));
    Ok(samples)
}

/// The adversary's search in round `round`: separate random situations, not those of the validation set; the worst few are made worse
/// by a local search.
///
/// # Errors
/// An impossible specification.
pub fn adversary(
    spec: &Spec,
    robot: &Robot,
    gains: &Gains,
    round: usize,
    threads: usize,
) -> Result<Vec<Sample>, ValidateError> {
    let found = evaluate_pool(spec, robot, gains, (round as u64 + 1) << 32, threads, &|_| {})?;
    let worst = &found[..spec.validation.added.min(found.len())];
    let mut worst_found = parallel::map(worst.len(), threads, |i| worsen(spec, robot, gains, &worst[i], TRIES))
        .into_iter()
        .collect::<Result<Vec<_>, _>>()?;
    for (k, sample) in worst_found.iter_mut().enumerate() {
        sample.model.name = format!("adversary {round}.{k}", round = round + 1, k = k + 1);
    }
    Ok(worst_found)
}

/// Steps of the adversary's local search.
const TRIES: usize = 20;

/// Makes a bad situation worse: random steps inside the ranges of the validation set, accepted when performance deteriorates.
///
/// # Errors
/// An impossible specification.
fn worsen(spec: &Spec, robot: &Robot, gains: &Gains, worst: &Sample, tries: usize) -> Result<Sample, ValidateError> {
    let v = &spec.validation;
    let mut worst = worst.clone();
    let mut rng = Rng::new(v.seed, 1 << 60);
    let mut size = 0.2;
    for _ in 0..tries {
        let mut model = worst.model.clone();
        let mut step = |x: f64, low: f64, high: f64| (x + size * (high - low) * (rng.uniform() - 0.5)).clamp(low, high);
        for (q, range) in model.joints_deg.iter_mut().zip(&v.joints_deg) {
            *q = step(*q, -range, *range);
        }
        model.base_mass = step(model.base_mass, 1.0 - v.mass, 1.0 + v.mass);
        model.base_inertia = step(model.base_inertia, 1.0 - v.mass, 1.0 + v.mass);
        model.arm_inertia = step(model.arm_inertia, 1.0 - v.mass, 1.0 + v.mass);
        model.fill = step(model.fill, v.fill[0], v.fill[1]);
        model.extra_delay_s = step(model.extra_delay_s, 0.0, v.extra_delay_s);
        let trial = assess(spec, robot, &model, gains, spec.sampling.pade_order_tuning)?;
        if trial.severity() > worst.severity() {
            worst = trial;
        } else {
            size *= 0.9;
        }
    }
    Ok(worst)
}

/// Sampled stability of every model of the specification, with slosh according to `slosh`.
///
/// # Errors
/// An impossible specification.
pub fn sampled_models(
    spec: &Spec,
    robot: &Robot,
    gains: &Gains,
    slosh: bool,
) -> Result<Vec<(String, super::sampled::SampledStability)>, RobotError> {
    spec.models
        .iter()
        .map(|m| {
            let mut model = m.clone();
            model.slosh |= slosh;
            Ok((model.name.clone(), sampled(spec, robot, &model, gains)?))
        })
        .collect()
}
