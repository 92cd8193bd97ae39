//! `orchestrator tune SPEC`: gains by structured H-infinity, verified before they are written.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, bail};
use clap::Args;
use synthesis::linalg::to_rows;
use synthesis::matrices::PlantMatrices;
use synthesis::mu::MarginOptions;
use synthesis::robot::{
    ChannelEntry, Design, GainTable, Gains, GainsFile, MarginEntry, Provenance, Robot, SampledEntry, Spec, Step,
    ValidationEntry, design, export, margins, sampled_models, tracking_optimum,
};
use synthesis::tuner::{Evaluation, Flow, Options, Phase, Progress, TuneError, tune};

use super::margins::{figures, print_margins, print_sampled};

/// Exit code: no stabilising gain was found, or the run broke down.
const FAILED: i32 = 1;
/// Exit code: the specification is wrong.
const REFUSED: i32 = 2;
/// Exit code: gains were found, but the verification contradicts them or the validation set does not pass.
const NOT_MET: i32 = 3;

/// Tune gains by structured H-infinity and verify them.
///
/// SPEC is a specification of the robot's velocity loop (`.toml`, see `gains/*.spec.toml`), or a plant as plain matrices
/// (`.json` with the keys A, B1, B, C1, C, D11, D12, D21, and optionally D22 and K), for which a static output feedback
/// u = K y is tuned.
///
/// Ctrl-C ends the search and keeps the best gains so far; a second one ends the program.
///
/// Exit code 0: tuned and verified. 1: no stabilising gain found. 2: the specification is wrong. 3: the verification or the
/// validation set is not passed.
#[derive(Debug, Args)]
pub struct TuneArgs {
    /// The specification
    pub spec: PathBuf,
    /// Where to write the gains; next to the specification when not given
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Number of starts, in place of the specification's
    #[arg(long)]
    pub starts: Option<usize>,
    /// Seed of the search, in place of the specification's
    #[arg(long)]
    pub seed: Option<u64>,
    /// Write the generalised plant, the gains and what is claimed as plain matrices
    #[arg(long, value_name = "FILE.json")]
    pub export_problem: Option<PathBuf>,
    /// Write singular values against weights, sensitivity and mu as SVG into this folder
    #[arg(long, value_name = "FOLDER")]
    pub plots: Option<PathBuf>,
    /// Leave out the margins (they take longer than the tuning)
    #[arg(long)]
    pub no_margins: bool,
    /// Print one line for a table of several designs: gamma, full-order optimum, margins
    #[arg(long)]
    pub table: bool,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// Tunes, verifies, writes; gives the exit code.
pub fn run(args: &TuneArgs) -> anyhow::Result<i32> {
    let text = match std::fs::read_to_string(&args.spec) {
        Ok(text) => text,
        Err(error) => {
            eprintln!("error: {}: {error}", args.spec.display());
            return Ok(REFUSED);
        }
    };
    let stop = Arc::new(AtomicBool::new(false));
    // The second Ctrl-C finds the flag set and ends the program; the order of these two lines makes it so.
    signal_hook::flag::register_conditional_shutdown(signal_hook::consts::SIGINT, 130, Arc::clone(&stop))?;
    signal_hook::flag::register(signal_hook::consts::SIGINT, Arc::clone(&stop))?;
    if args.spec.extension().is_some_and(|e| e == "json") {
        tune_matrices(args, &text, &stop)
    } else {
        tune_robot(args, &text, &stop)
    }
}

/// Prints progress on standard error, at most a few times a second.
struct Reporter<'a> {
    stop: &'a AtomicBool,
    last: Mutex<Option<Instant>>,
}

impl Reporter<'_> {
    fn say(&self, line: impl FnOnce() -> String) -> Flow {
        let mut last = self.last.lock().unwrap_or_else(PoisonError::into_inner);
        if last.is_none_or(|t| t.elapsed() > Duration::from_millis(400)) {
            *last = Some(Instant::now());
            eprintln!("{}", line());
        }
        if self.stop.load(Ordering::Relaxed) {
            Flow::Stop
        } else {
            Flow::Continue
        }
    }
}

fn progress_line(p: Progress) -> String {
    match p.phase {
        Phase::Stabilise => format!("start {}: stabilising, spectral abscissa {:.4e}", p.start + 1, p.value),
        Phase::Descend => format!("start {}: descending, gamma {:.5}", p.start + 1, p.value),
        Phase::Finish => format!("start {}: finishing, gamma {:.5}", p.start + 1, p.value),
    }
}

/// The exit code for a tuner that gave no gains.
fn failure(error: &TuneError) -> i32 {
    match error {
        TuneError::NotStabilised { .. } | TuneError::Stopped(_) | TuneError::Linalg(_) => FAILED,
        _ => REFUSED,
    }
}

fn tune_matrices(args: &TuneArgs, text: &str, stop: &AtomicBool) -> anyhow::Result<i32> {
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
            eprintln!("error: {error}");
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
    let mut out = std::io::stdout().lock();
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

fn tune_robot(args: &TuneArgs, text: &str, stop: &AtomicBool) -> anyhow::Result<i32> {
    let (mut spec, robot, urdf) = match load(&args.spec, text) {
        Ok(loaded) => loaded,
        Err(error) => {
            eprintln!("error: {}: {error:#}", args.spec.display());
            return Ok(REFUSED);
        }
    };
    spec.search.starts = args.starts.unwrap_or(spec.search.starts);
    spec.search.seed = args.seed.unwrap_or(spec.search.seed);
    let reporter = Reporter {
        stop,
        last: Mutex::new(None),
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let clock = Instant::now();
    let design = match design(&spec, &robot, threads, &|step| {
        reporter.say(|| match step {
            Step::Tune(p) => progress_line(p),
            Step::Validate(done) => format!("validating: {done} of {}", spec.validation.samples),
            Step::Adversary(gamma) => format!("the adversary adds a situation with gamma {gamma:.3}"),
        })
    }) {
        Ok(design) => design,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(match &error {
                synthesis::robot::ValidateError::Tune(error) => failure(error),
                synthesis::robot::ValidateError::Robot(_) => REFUSED,
            });
        }
    };
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
    let (mut file, mut complaints) = verify(args, &spec, &robot, &design)?;
    file.provenance.specification = args.spec.display().to_string();
    file.provenance.specification_digest = digest(text);
    file.provenance.plant_digest = digest(&urdf);
    if design.tuned.stopped {
        complaints.push("the search was stopped before it was done".into());
    }
    let path = args.out.clone().unwrap_or_else(|| gains_path(&args.spec));
    write(&path, &toml::to_string(&file)?)?;
    print(args, &spec, &file, tuning)?;
    for complaint in &complaints {
        eprintln!("not met: {complaint}");
    }
    eprintln!("gains written to {}", path.display());
    Ok(if complaints.is_empty() { 0 } else { NOT_MET })
}

/// Margins, sampled loops, validation: the file of gains, and what contradicts what.
fn verify(args: &TuneArgs, spec: &Spec, robot: &Robot, design: &Design) -> anyhow::Result<(GainsFile, Vec<String>)> {
    let mut complaints = Vec::new();
    let full_order = match tracking_optimum(spec, robot, &spec.models[0]) {
        Ok((low, high)) => vec![low, high],
        Err(error) => {
            eprintln!("note: no full-order optimum: {error}");
            Vec::new()
        }
    };
    let mut file = gains_file(spec, design, full_order);
    let nominal = sampled_models(spec, robot, &design.gains, false)?;
    let sloshing = sampled_models(spec, robot, &design.gains, true)?;
    for (slosh, list) in [(false, &nominal), (true, &sloshing)] {
        for (model, s) in list {
            if s.spectral_radius >= 1.0 {
                let with = if slosh { ", propellant sloshing" } else { "" };
                complaints.push(format!(
                    "{model}{with}: the sampled loop is unstable (spectral radius {:.6})",
                    s.spectral_radius
                ));
            }
            file.sampled.push(SampledEntry {
                model: model.clone(),
                slosh,
                spectral_radius: s.spectral_radius,
                gain_margin: s.gain_margin_up.min(f64::MAX),
                delay_margin_s: s.delay_margin_s,
            });
        }
    }
    if !args.no_margins {
        // The first model here; `margins` does all of them, which takes a minute for each.
        let all = stated_margins(spec, robot, &design.gains, 1)?;
        for (m, (_, s)) in all.iter().filter(|m| m.set.starts_with("complex")).zip(&nominal) {
            // A common real factor on all actuators is a member of the multiplicative set up to its low-frequency size.
            let promised = 1.0 + m.guaranteed * spec.uncertainty.multiplicative_low;
            if s.gain_margin_up < 0.98 * promised {
                complaints.push(format!(
                    "{}: the multiplicative margin promises a factor {promised:.3} on the gains, the sampled loop stands {:.3}",
                    m.model, s.gain_margin_up
                ));
            }
        }
        file.margins = all;
    }
    if let Some(v) = &design.validation {
        let worst = v
            .samples
            .iter()
            .filter(|s| s.stable())
            .map(|s| s.gamma)
            .fold(0.0, f64::max);
        file.validation = Some(ValidationEntry {
            samples: v.samples.len(),
            unstable: v.unstable(),
            worst_gamma: worst,
            histogram: v.histogram(),
        });
        if !v.passed() {
            complaints.push(format!(
                "validation: {} of {} situations unstable, worst gamma {worst:.3} against {}",
                v.unstable(),
                v.samples.len(),
                v.limit
            ));
        }
    }
    if let Some(folder) = &args.plots {
        for (name, svg) in figures(spec, robot, &design.reported_problem, &design.gains, !args.no_margins)? {
            write(&folder.join(name), &svg)?;
        }
    }
    Ok((file, complaints))
}

fn gains_file(spec: &Spec, design: &Design, full_order: Vec<f64>) -> GainsFile {
    let t = &design.tuned;
    GainsFile {
        provenance: Provenance {
            title: spec.title.clone(),
            specification: String::new(),
            specification_digest: String::new(),
            plant_digest: String::new(),
            version: env!("CARGO_PKG_VERSION").into(),
            seed: spec.search.seed,
            gamma: t.evaluation.gamma,
            gamma_reported: design.reported.gamma,
            starts: t.starts.iter().map(|g| format!("{g:.6}")).collect(),
            certificate: t.certificate.length,
            certificate_radius: t.certificate.radius,
            full_order,
            adversary_models: design.adversary.len(),
        },
        gains: GainTable::new(&design.gains),
        channels: channel_entries(&design.reported),
        margins: Vec::new(),
        sampled: Vec::new(),
        validation: None,
    }
}

/// Both margins of the first `count` models of the specification.
pub(super) fn stated_margins(
    spec: &Spec,
    robot: &Robot,
    gains: &Gains,
    count: usize,
) -> anyhow::Result<Vec<MarginEntry>> {
    let mut all = Vec::new();
    for model in spec.models.iter().take(count) {
        eprintln!("margins of {}", model.name);
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

/// Channel norms in the form of the file.
pub(super) fn channel_entries(evaluation: &Evaluation) -> Vec<ChannelEntry> {
    let entry = |c: &synthesis::tuner::ChannelReport| ChannelEntry {
        model: c.model.clone(),
        channel: c.channel.clone(),
        norm: c.norm,
        omega_rad_s: c.omega.min(f64::MAX),
    };
    evaluation.channels.iter().map(entry).collect()
}

fn print(args: &TuneArgs, spec: &Spec, file: &GainsFile, seconds: f64) -> anyhow::Result<()> {
    let mut out = std::io::stdout().lock();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(file)?)?;
        return Ok(());
    }
    let p = &file.provenance;
    if args.table {
        let optimum = p.full_order.last().map_or("-".into(), |x| format!("{x:.3}"));
        let margins: Vec<String> = file
            .margins
            .iter()
            .map(|m| format!("{:.3}..{:.3}", m.guaranteed, m.destabilising))
            .collect();
        writeln!(
            out,
            "| {} | {:.4} | {:.4} | {optimum} | {} | {seconds:.1} |",
            spec.title,
            p.gamma,
            p.gamma_reported,
            margins.join(", ")
        )?;
        return Ok(());
    }
    writeln!(out, "{}\n", spec.title)?;
    writeln!(
        out,
        "gamma {:.5} (delays to order {}: {:.5}), tuned in {seconds:.1} s",
        p.gamma, spec.sampling.pade_order_reporting, p.gamma_reported
    )?;
    writeln!(
        out,
        "starts {}; certificate {:.1e} within {:.0e}",
        p.starts.join(" "),
        p.certificate,
        p.certificate_radius
    )?;
    if let [low, high] = p.full_order[..] {
        writeln!(
            out,
            "full-order optimum of the tracking channel, {}: between {low:.4} and {high:.4}",
            spec.models[0].name
        )?;
    }
    writeln!(
        out,
        "\n{:16} {:10} {:>9} {:>12}",
        "model", "channel", "norm", "peak rad/s"
    )?;
    for c in &file.channels {
        writeln!(
            out,
            "{:16} {:10} {:9.4} {:12.4}",
            c.model, c.channel, c.norm, c.omega_rad_s
        )?;
    }
    print_sampled(&mut out, &file.sampled)?;
    print_margins(&mut out, &file.margins)?;
    if let Some(v) = &file.validation {
        writeln!(
            out,
            "\nvalidation: {} situations, {} unstable, worst gamma {:.3}",
            v.samples, v.unstable, v.worst_gamma
        )?;
        for (edge, count) in &v.histogram {
            writeln!(out, "  from {edge:5.2} {count:4} {}", "#".repeat(*count))?;
        }
    }
    Ok(())
}

/// Reads a specification and the robot it names. The description's path is taken from the working directory, from the
/// folder of the specification, or from the folder above it, whichever has it.
pub(super) fn load(path: &Path, text: &str) -> anyhow::Result<(Spec, Robot, String)> {
    let spec: Spec = toml::from_str(text)?;
    let here = path.parent().unwrap_or(Path::new("."));
    let candidates = [
        PathBuf::from(&spec.robot.urdf),
        here.join(&spec.robot.urdf),
        here.join("..").join(&spec.robot.urdf),
    ];
    let Some(found) = candidates.iter().find(|p| p.is_file()) else {
        bail!(
            "robot.urdf = {:?}: no such file here, beside the specification, or above it",
            spec.robot.urdf
        )
    };
    let urdf = std::fs::read_to_string(found).with_context(|| found.display().to_string())?;
    let robot = Robot::new(&urdf, &spec.robot)?;
    spec.check(robot.channels())?;
    Ok((spec, robot, urdf))
}

/// `x.spec.toml` becomes `x.toml`; anything else gets `.gains.toml`, so that a specification is never overwritten.
fn gains_path(spec: &Path) -> PathBuf {
    let name = spec
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    match name.strip_suffix(".spec.toml") {
        Some(stem) => spec.with_file_name(format!("{stem}.toml")),
        None => spec.with_extension("gains.toml"),
    }
}

/// Digest of a text, to notice a change: 64-bit FNV-1a.
pub(super) fn digest(text: &str) -> String {
    let hash = text.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| {
        (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3)
    });
    format!("fnv1a64:{hash:016x}")
}

pub(super) fn write(path: &Path, text: &str) -> anyhow::Result<()> {
    if let Some(folder) = path.parent().filter(|f| !f.as_os_str().is_empty()) {
        std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    }
    std::fs::write(path, text).with_context(|| path.display().to_string())
}
