//! Verification of a design: all claims of its file, computed.

use synthesis::robot::{Design, GainTable, GainsFile, Provenance, Robot, Spec};
use synthesis::tuner::Verdict;

use super::arguments::TuneArgs;
use crate::catalogue::catalogue;
use crate::commands::gains::{
    Reporter, channel_entries, contradictions, margin_entries, optima, plots, sampled_entries, validation_entry, write,
};
use capture::closed_loop;

/// Margins, sampled loops, closed-loop simulations, validation: the file of gains, and the contradictions in it.
pub(super) fn verify(
    args: &TuneArgs,
    spec: &Spec,
    robot: &Robot,
    design: &Design,
    reporter: &Reporter<'_>,
) -> anyhow::Result<(GainsFile, Vec<String>)> {
    let mut file = gains_file(spec, design);
    file.full_order = optima(spec, robot, &design.adversary);
    file.sampled = sampled_entries(spec, robot, &design.gains)?;
    let mut unmet = Vec::new();
    if design.tuned.verdict != Verdict::Attained {
        unmet.push(design.tuned.verdict.to_string());
    }
    // The gains were expensive: later failures are reported in addition to them and do not discard them.
    if !args.no_margins {
        match margin_entries(spec, robot, &design.gains, usize::MAX, &|done, all| {
            reporter.progress_or_stop("margins of model", done, all)
        }) {
            Ok(margins) => file.margins = margins,
            Err(error) => unmet.push(format!("margins: {error:#}")),
        }
    }
    if !args.no_closed_loop {
        match closed_loop::simulate_gains(catalogue(), &args.spec, spec, robot, &design.gains, &|done, all| {
            reporter.progress_or_stop("closed loop", done, all)
        }) {
            Ok(entries) => file.closed_loop = entries,
            Err(error) => unmet.push(format!("closed loop: {error:#}")),
        }
    }
    reporter.finish();
    if let Some(v) = &design.validation {
        file.validation = Some(validation_entry(v));
    }
    unmet.extend(contradictions(spec, &file));
    if let Some(folder) = &args.plots {
        for (name, svg) in plots(spec, robot, &design.reported_problem, &design.gains, !args.no_margins)? {
            write(&folder.join(name), &svg)?;
        }
    }
    Ok((file, unmet))
}

fn gains_file(spec: &Spec, design: &Design) -> GainsFile {
    let t = &design.tuned;
    GainsFile {
        provenance: Provenance {
            title: spec.title.clone(),
            specification: String::new(),
            specification_digest: String::new(),
            plant_digest: String::new(),
            controller_period_s: Some(spec.sampling.controller_period_s),
            ks: None,
            version: env!("CARGO_PKG_VERSION").into(),
            seed: spec.search.seed,
            gamma: t.evaluation.gamma,
            gamma_reported: design.reported.gamma,
            starts: t.starts.iter().map(|g| format!("{g:.6}")).collect(),
            certificate: t.certificate.length,
            certificate_steepest: t.certificate.steepest,
            certificate_radius: t.certificate.radius,
        },
        gains: GainTable::new(&design.gains),
        models: spec.models.clone(),
        channels: channel_entries(&design.reported),
        margins: Vec::new(),
        sampled: Vec::new(),
        closed_loop: Vec::new(),
        full_order: Vec::new(),
        validation: None,
        rounds: if design.rounds.len() > 1 {
            design.rounds.clone()
        } else {
            Vec::new()
        },
        adversary: design.adversary.clone(),
    }
}
