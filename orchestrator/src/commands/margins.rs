//! `escapement margins GAINS`: what gains tolerate, recomputed from their file and the specification it names.

use crate::program::catalogue;
use std::io::Write;
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use clap::Args;
use synthesis::linalg::singular_values;
use synthesis::mu::{MarginOptions, margin, upper_bound};
use synthesis::norm::gain_at;
use synthesis::plot::{Curve, figure};
use synthesis::robot::{
    FlownEntry, Gains, GainsFile, MarginEntry, Robot, SampledEntry, Spec, export, multiplicative_loop, report,
    tracking_weights, validate,
};
use synthesis::tuner::{Problem, controllers};

use super::tune::{
    Reporter, channel_entries, contradictions, load, optima, print_validation, recall, sampled_entries, sliding_gain,
    stated_margins, take_sliding_gain, threads, validation_entry, write,
};
use capture::flight::fly;
use capture::provenance::{digest, plant_digest};

/// Exit code: a file is missing or wrong.
const REFUSED: i32 = 2;
/// Exit code: the file claims a gamma that is not reproduced, or a sampled loop is unstable.
const NOT_MET: i32 = 3;
/// Relative difference in gamma that is put down to rounding.
const SAME: f64 = 1e-6;

/// Recompute norms, margins and the sampled loop of tuned gains.
///
/// Margins are multiples of the stated uncertainty: 1.5 means that the loop stays stable for every error up to one and a half
/// times the set. The first number is guaranteed for all frequencies, the second is the size of an error that destabilises.
///
/// Exit code 0: the file's gamma is reproduced, every sampled loop is stable, and no flight contradicts that. 2: a file is missing or
/// wrong. 3: otherwise.
#[derive(Debug, Args)]
pub struct MarginsArgs {
    /// A file of gains, as written by `tune`
    pub gains: PathBuf,
    /// The specification, in place of the one the file names
    #[arg(long, value_name = "FILE")]
    pub spec: Option<PathBuf>,
    /// Only the first so many models of the specification (a margin takes seconds)
    #[arg(long, value_name = "COUNT")]
    pub models: Option<usize>,
    /// Go on with links of the robot that no distribution of mass has; they are warned of
    #[arg(long)]
    pub allow_unphysical: bool,
    /// Leave out the flights in the non-linear simulator
    #[arg(long)]
    pub no_flights: bool,
    /// Write what was recomputed back into the file
    #[arg(long)]
    pub update: bool,
    /// Print one table line per margin, for a page
    #[arg(long)]
    pub table: bool,
    /// Write the generalised plants at the reporting order, the gains and their norms as plain matrices
    #[arg(long, value_name = "FILE.json")]
    pub export_problem: Option<PathBuf>,
    /// Write singular values against weights, sensitivity and mu as SVG into this folder
    #[arg(long, value_name = "FOLDER")]
    pub plots: Option<PathBuf>,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// Recomputes and prints; gives the exit code.
pub fn run(args: &MarginsArgs) -> anyhow::Result<i32> {
    let loaded = (|| {
        let mut file: GainsFile = toml::from_str(&std::fs::read_to_string(&args.gains)?)?;
        let path = args
            .spec
            .clone()
            .unwrap_or_else(|| PathBuf::from(&file.provenance.specification));
        let text =
            std::fs::read_to_string(&path).map_err(|e| anyhow::anyhow!("specification {}: {e}", path.display()))?;
        let (mut spec, robot, urdf) = load(&path, &text, args.allow_unphysical)?;
        recall(&path, &mut spec, &file.models)?;
        file.models.clone_from(&spec.models);
        let provenance = &mut file.provenance;
        for (what, now, then) in [
            ("the specification", digest(&text), &mut provenance.specification_digest),
            (
                "the robot",
                plant_digest(&urdf).unwrap_or_default(),
                &mut provenance.plant_digest,
            ),
        ] {
            if *then != now {
                eprintln!("note: {what} has changed since these gains were tuned");
                *then = now;
            }
        }
        provenance.controller_period_s = Some(spec.sampling.controller_period_s);
        if let Some(proportional) = sliding_gain(&path, &spec, &urdf)?
            && take_sliding_gain(&mut file, &spec, &proportional)
        {
            let named = spec.gains.ks.clone().unwrap_or_default();
            eprintln!("note: K_S of this file is not the K_P of {named}; --update takes it from there");
        }
        let gains = file.gains.gains()?;
        if gains.structure != spec.gains.structure {
            anyhow::bail!(
                "gains.structure is {:?}, but gains.structure of {} is {:?}: these are not gains of that specification",
                gains.structure,
                path.display(),
                spec.gains.structure
            );
        }
        anyhow::Ok((file, path, spec, robot, gains))
    })();
    let (mut file, path, spec, robot, gains) = match loaded {
        Ok(loaded) => loaded,
        Err(error) => {
            eprintln!("error: {}: {error:#}", args.gains.display());
            return Ok(REFUSED);
        }
    };
    let (problem, evaluation) = report(&spec, &robot, &file.adversary, &gains)?;
    let claimed = file.provenance.gamma_reported;
    let tolerable = (evaluation.gamma - claimed).abs() <= SAME * claimed;
    file.provenance.gamma_reported = evaluation.gamma;
    file.channels = channel_entries(&evaluation);
    file.sampled = sampled_entries(&spec, &robot, &gains)?;
    file.full_order = optima(&spec, &robot, &file.adversary);
    if spec.validation.samples > 0 {
        file.validation = Some(validation_entry(&validate(&spec, &robot, &gains, threads(), &|_| {})?));
    }
    let never = AtomicBool::new(false);
    let reporter = Reporter::new(&never);
    file.flown = if args.no_flights {
        Vec::new()
    } else {
        fly(catalogue(), &path, &spec, &robot, &gains, &|done, all| {
            reporter.next("flight", done, all)
        })?
    };
    file.margins = stated_margins(
        &spec,
        &robot,
        &gains,
        args.models.unwrap_or(usize::MAX),
        &|done, all| reporter.next("margins of model", done, all),
    )?;
    reporter.over();
    if let Some(path) = &args.export_problem {
        let (blocks, controllers) = controllers(&problem)?;
        let exported = export(&problem, &blocks, &controllers, &evaluation, None);
        write(path, &serde_json::to_string(&exported)?)?;
    }
    if let Some(folder) = &args.plots {
        for (name, svg) in figures(&spec, &robot, &problem, &gains, true)? {
            write(&folder.join(name), &svg)?;
        }
    }
    let mut out = crate::output::stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&file)?)?;
    } else if args.table {
        for m in &file.margins {
            writeln!(
                out,
                "| {} | {} | {} | {:.3} | {:.3} | {:.2} |",
                spec.title, m.model, m.set, m.guaranteed, m.destabilising, m.critical_rad_s
            )?;
        }
    } else {
        writeln!(
            out,
            "{}: gamma {:.5} (the file says {claimed:.5})",
            spec.title, evaluation.gamma
        )?;
        print_sampled(&mut out, &file.sampled)?;
        print_flown(&mut out, &file.flown)?;
        print_margins(&mut out, &file.margins)?;
        print_validation(&mut out, &spec, file.validation.as_ref())?;
    }
    if !tolerable {
        eprintln!(
            "not met: the file claims gamma {claimed:.8}, recomputed {:.8}",
            evaluation.gamma
        );
    }
    let complaints = contradictions(&spec, &file);
    for complaint in &complaints {
        eprintln!("not met: {complaint}");
    }
    if args.update {
        if !tolerable {
            eprintln!("not updated: these are not the gains of which the file speaks; tune again");
            return Ok(NOT_MET);
        }
        write(&args.gains, &toml::to_string(&file)?)?;
        eprintln!("{} updated", args.gains.display());
    }
    Ok(if tolerable && complaints.is_empty() { 0 } else { NOT_MET })
}

/// The table of flights.
pub(super) fn print_flown(out: &mut impl Write, list: &[FlownEntry]) -> anyhow::Result<()> {
    if list.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "\n{:16} {:>13} {:>15} {:>9} {:>12}",
        "flight", "delays ms", "spectral radius", "settles", "saturated %"
    )?;
    for f in list {
        writeln!(
            out,
            "{:16} {:>13} {:15.8} {:>9} {:12.1}",
            f.model,
            format!("{0:.0} + {0:.0}", 1e3 * f.delay_s),
            f.spectral_radius,
            if f.settled { "yes" } else { "no" },
            100.0 * f.saturated_fraction
        )?;
    }
    Ok(())
}

/// The table of sampled loops.
pub(super) fn print_sampled(out: &mut impl Write, list: &[SampledEntry]) -> anyhow::Result<()> {
    if list.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "\n{:16} {:>8} {:>15} {:>12} {:>14}",
        "sampled loop", "slosh", "spectral radius", "gain margin", "delay margin s"
    )?;
    for s in list {
        let slosh = if s.slosh { "free" } else { "frozen" };
        writeln!(
            out,
            "{:16} {slosh:>8} {:15.8} {:12.3} {:14.3}",
            s.model, s.spectral_radius, s.gain_margin, s.delay_margin_s
        )?;
    }
    Ok(())
}

/// The table of margins.
pub(super) fn print_margins(out: &mut impl Write, list: &[MarginEntry]) -> anyhow::Result<()> {
    if list.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "\nmargins, in multiples of the stated set: guaranteed, destabilising, critical rad/s"
    )?;
    for m in list {
        writeln!(
            out,
            "{:16} {:9.4} {:9.4} {:9.3}   {}",
            m.model, m.guaranteed, m.destabilising, m.critical_rad_s, m.set
        )?;
    }
    Ok(())
}

/// Figures of the first model: singular values of the channels, sensitivity against its weight, mu bounds.
pub(super) fn figures(
    spec: &Spec,
    robot: &Robot,
    problem: &Problem,
    gains: &Gains,
    with_mu: bool,
) -> anyhow::Result<Vec<(String, String)>> {
    let model = &problem.models[0];
    let n = robot.channels();
    let controller = {
        let mass = robot.body(&spec.models[0])?.mass;
        let kp = synthesis::linalg::to_rows(&gains.proportional(&mass)?);
        let rows: Vec<Vec<f64>> = (0..n)
            .map(|i| {
                let mut row = kp[i].clone();
                row.extend((0..gains.ki.len()).map(|j| if i == j { gains.ki[i] } else { 0.0 }));
                row
            })
            .collect();
        synthesis::state_space::StateSpace::gain(synthesis::linalg::from_rows(&rows)?)
    };
    let closed = synthesis::interconnect::lft_lower(&model.plant, &controller)?;
    let grid: Vec<f64> = (0..160)
        .map(|i| 10f64.powf(-3.0 + 6.0 * f64::from(i) / 159.0))
        .collect();
    let curve = |name: &str, dashed: bool, f: &dyn Fn(f64) -> anyhow::Result<f64>| -> anyhow::Result<Curve> {
        let points = grid
            .iter()
            .map(|&w| Ok((w, f(w)?)))
            .collect::<anyhow::Result<Vec<_>>>()?;
        Ok(Curve {
            name: name.into(),
            points,
            dashed,
        })
    };
    let mut channels = Vec::new();
    for c in &model.channels {
        let part = closed.select(c.outputs.clone(), c.inputs.clone());
        channels.push(curve(&c.name, false, &|w| Ok(gain_at(&part, w)?))?);
    }
    channels.push(curve("one: weights met", true, &|_| Ok(1.0))?);
    // z₁ is the weighted sensitivity: undoing the weight per channel gives the sensitivity in units of the error sizes.
    let weighted = closed.select(0..n, 0..n);
    let weights = tracking_weights(spec)?;
    let mut sensitivity = Vec::new();
    for (i, name) in [(0, "rotation x"), (3, "translation x"), (6, "first joint")] {
        let own = weighted.select(i..i + 1, i..i + 1);
        let weight = weights.select(i..i + 1, i..i + 1);
        sensitivity.push(curve(name, false, &|w| Ok(gain_at(&own, w)? / gain_at(&weight, w)?))?);
        sensitivity.push(curve(&format!("{name}: bound"), true, &|w| {
            Ok(1.0 / gain_at(&weight, w)?)
        })?);
    }
    let x_name = "frequency, rad/s";
    let mut all = vec![
        (
            "channels.svg".to_string(),
            figure("Weighted channels: largest singular value", x_name, "gain", &channels),
        ),
        (
            "sensitivity.svg".to_string(),
            figure("Sensitivity against its bounds", x_name, "|S|", &sensitivity),
        ),
    ];
    if with_mu {
        let (system, structure) = multiplicative_loop(spec, robot, &spec.models[0], gains)?;
        let found = margin(&system, &structure, &MarginOptions::default())?;
        let upper = found.curve.iter().copied().filter(|p| p.0.is_finite()).collect();
        let unstructured = curve("largest singular value", true, &|w| {
            Ok(singular_values(&system.at(w))?[0])
        })?;
        let guaranteed = curve("guaranteed for all frequencies", true, &|_| Ok(1.0 / found.guaranteed))?;
        let mut curves = vec![
            Curve {
                name: "mu, upper bound".into(),
                points: upper,
                dashed: false,
            },
            unstructured,
            guaranteed,
        ];
        if let Some(p) = &found.perturbation {
            let at = upper_bound(&system.at(p.omega), &structure, 1e-4)?.value;
            let points = vec![(p.omega, 1.0 / p.size), (p.omega, at.max(1.0 / p.size))];
            curves.push(Curve {
                name: "mu, lower bound (perturbation found)".into(),
                points,
                dashed: false,
            });
        }
        all.push((
            "mu.svg".to_string(),
            figure("mu for multiplicative errors at the actuators", x_name, "mu", &curves),
        ));
    }
    Ok(all)
}
