//! `escapement margins GAINS`: margins of gains, recomputed from their file and the specification it names.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;

use anyhow::Context as _;
use clap::Args;
use synthesis::robot::{Gains, GainsFile, Robot, Spec, ValidateError, export, report, validate};
use synthesis::tuner::{Evaluation, Problem, TuneError, controllers};

use super::gains::{
    Reporter, at_line, channel_entries, contradictions, files_of, json, load, margin_entries, optima, plots,
    print_closed_loop, print_margins, print_sampled, print_validation, restore_recorded_angles, sampled_entries,
    sliding_gain, take_sliding_gain, threads, validation_entry, write,
};
use crate::catalogue::catalogue;
use crate::destination;
use crate::refusal::Refusal;
use capture::closed_loop::simulate_gains;
use capture::provenance::{digest, plant_digest};

/// Exit code: a file is missing or wrong.
const REFUSED: i32 = 2;
/// Exit code: the file claims a gamma that is not reproduced, or a sampled loop is unstable.
const NOT_MET: i32 = 3;
/// Relative difference in gamma that is attributed to rounding.
const SAME: f64 = 1e-6;

/// Arguments of `margins`.
#[derive(Debug, Args)]
pub struct MarginsArgs {
    /// A file of gains, as written by `tune`
    pub gains: PathBuf,
    /// The specification, instead of the one that the file names
    #[arg(long, value_name = "FILE")]
    pub spec: Option<PathBuf>,
    /// The number of models of the specification to verify, from the first (a margin takes seconds)
    #[arg(long, value_name = "COUNT")]
    pub models: Option<usize>,
    /// Accept links of the robot with inertias that no distribution of mass has, with a warning
    #[arg(long)]
    pub allow_unphysical: bool,
    /// Leave out the closed-loop runs in the non-linear simulator
    #[arg(long)]
    pub no_closed_loop: bool,
    /// Write what was recomputed back into the file
    #[arg(long)]
    pub update: bool,
    /// Print one line of a Markdown table per margin
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

/// Gains with their specification and robot.
struct Loaded {
    /// The file of gains, updated with the present specification and robot.
    file: GainsFile,
    /// The path of the specification.
    path: PathBuf,
    spec: Spec,
    robot: Robot,
    gains: Gains,
}

/// Recomputes and prints; returns the exit code.
pub fn run(args: &MarginsArgs) -> anyhow::Result<i32> {
    let mut loaded = match read(args) {
        Ok(loaded) => loaded,
        Err(error) => {
            eprintln!("error: {}: {error:#}", args.gains.display());
            return Ok(REFUSED);
        }
    };
    if let Some(path) = &args.export_problem {
        let mut named = files_of(&loaded.path, &loaded.spec);
        named.extend([
            ("GAINS", args.gains.clone()),
            ("the specification", loaded.path.clone()),
        ]);
        let named: Vec<(&str, &Path)> = named.iter().map(|(key, file)| (*key, file.as_path())).collect();
        destination::check_distinct(&named, &[("--export-problem", path)])?;
    }
    let claimed = loaded.file.provenance.gamma_reported;
    let (problem, evaluation) = recompute(args, &mut loaded)?;
    let Loaded {
        file,
        spec,
        robot,
        gains,
        ..
    } = &loaded;
    let tolerable = (evaluation.gamma - claimed).abs() <= SAME * claimed;
    if let Some(path) = &args.export_problem {
        let (blocks, controllers) = controllers(&problem)?;
        let exported = export(&problem, &blocks, &controllers, &evaluation, None);
        write(path, &serde_json::to_string(&exported)?)?;
    }
    if let Some(folder) = &args.plots {
        for (name, svg) in plots(spec, robot, &problem, gains, true)? {
            write(&folder.join(name), &svg)?;
        }
    }
    print(args, spec, file, claimed)?;
    if !tolerable {
        eprintln!(
            "not met: the file claims gamma {claimed:.8}, recomputed {:.8}",
            evaluation.gamma
        );
    }
    let unmet = contradictions(spec, file);
    for reason in &unmet {
        eprintln!("not met: {reason}");
    }
    if args.update {
        if !tolerable {
            eprintln!("not updated: these are not the gains of which the file speaks; tune again");
            return Ok(NOT_MET);
        }
        write(&args.gains, &toml::to_string(file)?)?;
        eprintln!("{} updated", args.gains.display());
    }
    Ok(if tolerable && unmet.is_empty() { 0 } else { NOT_MET })
}

/// Reads the gains, their specification and the robot.
fn read(args: &MarginsArgs) -> anyhow::Result<Loaded> {
    let written = std::fs::read_to_string(&args.gains)?;
    let mut file = gains_file(&written)?;
    let path = args
        .spec
        .clone()
        .unwrap_or_else(|| PathBuf::from(&file.provenance.specification));
    let text = std::fs::read_to_string(&path).map_err(|e| anyhow::anyhow!("specification {}: {e}", path.display()))?;
    let specification = || format!("specification {}", path.display());
    let (mut spec, robot, urdf) = load(&path, &text, args.allow_unphysical).with_context(specification)?;
    restore_recorded_angles(&path, &mut spec, &file.models)?;
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
    if file.gains.structure != spec.gains.structure {
        anyhow::bail!(
            "gains.structure is {:?}, but gains.structure of {} is {:?}: these are not gains of that specification",
            file.gains.structure,
            path.display(),
            spec.gains.structure
        );
    }
    let checked = file.gains.check(robot.channels(), spec.gains.integral);
    checked.map_err(|error| at_line(&written, &error))?;
    let gains = file.gains.gains()?;
    Ok(Loaded {
        file,
        path,
        spec,
        robot,
        gains,
    })
}

/// Reads a file of gains with their provenance: without it there is no specification to verify them against.
fn gains_file(text: &str) -> anyhow::Result<GainsFile> {
    let remedy = "only gains that `escapement tune` wrote for a specification (.spec.toml) can be verified: they say what they were \
                  tuned for";
    if serde_json::from_str::<serde_json::Value>(text).is_ok() {
        anyhow::bail!("this is JSON, such as the result for a plant of matrices; {remedy}");
    }
    let table: toml::Table = toml::from_str(text)?;
    if !table.contains_key("provenance") {
        let what = if table.contains_key("weights") || table.contains_key("models") {
            "this is a specification"
        } else {
            "these gains have no table `provenance`"
        };
        anyhow::bail!("{what}; {remedy}");
    }
    // from the text, so that a mistake has its line
    Ok(toml::from_str(text)?)
}

/// Recomputes all claims of a file of gains.
fn recompute(args: &MarginsArgs, loaded: &mut Loaded) -> anyhow::Result<(Problem, Evaluation)> {
    let Loaded {
        file,
        path,
        spec,
        robot,
        gains,
    } = loaded;
    let (problem, evaluation) = report(spec, robot, &file.adversary, gains).map_err(|error| match &error {
        ValidateError::Tune(TuneError::Linalg(_)) => anyhow::Error::from(error),
        // What the tuner refuses is in the files.
        _ => Refusal::of(anyhow::anyhow!("{}: {error}", args.gains.display())).into(),
    })?;
    file.provenance.gamma_reported = evaluation.gamma;
    file.channels = channel_entries(&evaluation);
    file.sampled = sampled_entries(spec, robot, gains)?;
    file.full_order = optima(spec, robot, &file.adversary);
    if spec.validation.samples > 0 {
        file.validation = Some(validation_entry(&validate(spec, robot, gains, threads(), &|_| {})?));
    }
    let never = AtomicBool::new(false);
    let reporter = Reporter::new(&never);
    file.closed_loop = if args.no_closed_loop {
        Vec::new()
    } else {
        simulate_gains(catalogue(), path, spec, robot, gains, &|done, all| {
            reporter.progress_or_stop("closed loop", done, all)
        })?
    };
    let count = args.models.unwrap_or(usize::MAX);
    file.margins = margin_entries(spec, robot, gains, count, &|done, all| {
        reporter.progress_or_stop("margins of model", done, all)
    })?;
    reporter.finish();
    Ok((problem, evaluation))
}

/// Prints the file in the requested form; `claimed` is its previous gamma.
fn print(args: &MarginsArgs, spec: &Spec, file: &GainsFile, claimed: f64) -> anyhow::Result<()> {
    let mut out = crate::output::stdout();
    if args.json {
        writeln!(out, "{}", json(file)?)?;
    } else if args.table {
        for m in &file.margins {
            writeln!(
                out,
                "| {} | {} | {} | {:.3} | {:.3} | {:.2} |",
                spec.title, m.model, m.set, m.guaranteed, m.destabilising, m.critical_rad_s
            )?;
        }
    } else {
        let gamma = file.provenance.gamma_reported;
        writeln!(out, "{}: gamma {gamma:.5} (the file says {claimed:.5})", spec.title)?;
        print_sampled(&mut out, &file.sampled)?;
        print_closed_loop(&mut out, &file.closed_loop)?;
        print_margins(&mut out, &file.margins)?;
        print_validation(&mut out, spec, file.validation.as_ref())?;
    }
    Ok(())
}
