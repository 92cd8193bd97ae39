//! Computed entries of a file of gains: norms, margins, sampled loops, validation; and contradictions between them.

use synthesis::mu::MarginOptions;
use synthesis::robot::{
    ChannelEntry, Gains, GainsFile, MarginEntry, ModelSpec, OptimumEntry, Robot, RobotError, SampledEntry, Spec,
    Validation, ValidationEntry, margins, sampled_models, tracking_optimum,
};
use synthesis::tuner::Evaluation;

/// Contradictions in a file of gains, and requirements of the specification that it does not meet.
pub fn contradictions(spec: &Spec, file: &GainsFile) -> Vec<String> {
    let mut out = Vec::new();
    for s in file.sampled.iter().filter(|s| s.spectral_radius >= 1.0) {
        let with = if s.slosh { ", propellant sloshing" } else { "" };
        out.push(format!(
            "{}{with}: the sampled loop is unstable (spectral radius {:.6})",
            s.model, s.spectral_radius
        ));
    }
    for m in file.margins.iter().filter(|m| m.set.starts_with("complex")) {
        // A common real factor on all actuators is a member of the multiplicative set up to its low-frequency size.
        let promised = 1.0 + m.guaranteed * spec.uncertainty.multiplicative_low;
        for s in file.sampled.iter().filter(|s| s.model == m.model && !s.slosh) {
            if s.gain_margin < 0.98 * promised {
                out.push(format!(
                    "{}: the multiplicative margin promises a factor {promised:.3} on the gains, the sampled loop stands {:.3}",
                    m.model, s.gain_margin
                ));
            }
        }
    }
    for f in file.closed_loop.iter().filter(|f| f.contradicts()) {
        out.push(format!(
            "{}, {:.1} ms of delay each way: the sampled loop is stable (spectral radius {:.6}), but the simulation does not settle",
            f.model,
            1e3 * f.delay_s,
            f.spectral_radius
        ));
    }
    if let Some(v) = &file.validation
        && (v.unstable > 0 || v.worst_gamma > spec.validation.gamma)
    {
        out.push(format!(
            "validation: of {} situations {} are unstable and {} of the others above the limit of {} (worst gamma {:.3})",
            v.samples, v.unstable, v.above, spec.validation.gamma, v.worst_gamma
        ));
    }
    out
}

/// The sampled loop of every model, with frozen and with sloshing propellant.
pub fn sampled_entries(spec: &Spec, robot: &Robot, gains: &Gains) -> Result<Vec<SampledEntry>, RobotError> {
    let mut all = Vec::new();
    for slosh in [false, true] {
        for (model, s) in sampled_models(spec, robot, gains, slosh)? {
            all.push(SampledEntry {
                model,
                slosh,
                spectral_radius: s.spectral_radius,
                gain_margin: s.gain_margin_up.min(f64::MAX),
                delay_margin_s: s.delay_margin_s,
            });
        }
    }
    Ok(all)
}

/// A validation in the file's format.
pub fn validation_entry(v: &Validation) -> ValidationEntry {
    ValidationEntry {
        samples: v.samples.len(),
        unstable: v.unstable(),
        above: v.above(),
        worst_gamma: v.worst_gamma(),
        histogram: v.histogram(),
    }
}

/// The best performance that any controller can reach in every model of the specification and of the adversary.
pub fn optima(spec: &Spec, robot: &Robot, adversary: &[ModelSpec]) -> Vec<OptimumEntry> {
    let mut all = Vec::new();
    for model in spec.models.iter().chain(adversary) {
        match tracking_optimum(spec, robot, model) {
            Ok(range) => all.push(OptimumEntry::new(&model.name, range)),
            Err(error) => eprintln!("note: no full-order optimum of {}: {error}", model.name),
        }
    }
    all
}

/// Both margins of the first `count` models of the specification. `next` is called with the number of computed margins and
/// the total, and returns whether to stop.
pub fn margin_entries(
    spec: &Spec,
    robot: &Robot,
    gains: &Gains,
    count: usize,
    next: &dyn Fn(usize, usize) -> bool,
) -> anyhow::Result<Vec<MarginEntry>> {
    let mut all = Vec::new();
    let count = count.min(spec.models.len());
    for (done, model) in spec.models.iter().take(count).enumerate() {
        if next(done, count) {
            break;
        }
        for stated in margins(spec, robot, model, gains, &MarginOptions::default())? {
            all.push(MarginEntry {
                set: stated.set,
                model: stated.model,
                guaranteed: stated.margin.guaranteed.min(f64::MAX),
                destabilising: stated.margin.destabilising.min(f64::MAX),
                critical_rad_s: stated.margin.critical.min(f64::MAX),
            });
        }
    }
    Ok(all)
}

/// Channel norms in the file's format.
pub fn channel_entries(evaluation: &Evaluation) -> Vec<ChannelEntry> {
    let entry = |c: &synthesis::tuner::ChannelReport| ChannelEntry {
        model: c.model.clone(),
        channel: c.channel.clone(),
        norm: c.norm,
        omega_rad_s: c.omega.min(f64::MAX),
    };
    evaluation.channels.iter().map(entry).collect()
}
