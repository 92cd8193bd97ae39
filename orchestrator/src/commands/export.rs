//! `escapement export RUN --to FORMAT`: conversion of a tape to files for other tools.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use clap::{Args, ValueEnum};
use lockstep::time::Rational;
use report::export::{self, Compression};
use report::page::{PlanFile, ReportError, read_json, scene_of};
use tape::folder::RunFolder;
use tape::{Excerpt, ExcerptSpec, ReadError, Reader, Source};

use super::outputs::register_outputs;
use super::seal::{SealArgs, read_error_text, warn_incomplete_records};
use crate::arguments::{parse_instant, parse_model};
use crate::catalogue::catalogue;
use crate::destination;
use crate::line::Busy;
use crate::refusal::Refusal;
use engine::scenario::in_path;

/// Exit code: the folder is not a run, or a file of it cannot be read.
const UNREADABLE: i32 = 2;
/// Exit code: a file could not be written.
const UNWRITABLE: i32 = 1;

/// The formats.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Format {
    /// One comma-separated file per stream
    Csv,
    /// One Parquet file per stream, with units in the columns' metadata
    Parquet,
    /// One MAT file (version 5, for MATLAB, Octave and SciPy) with a struct per stream
    Mat,
    /// One MCAP file with protobuf messages, frame transforms and a scene
    Mcap,
    /// The MCAP file, and a Rerun recording that the program `rerun` in PATH makes of it
    Rrd,
}

/// How an MCAP file is compressed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum CompressionArg {
    /// LZ4, chunk by chunk
    Lz4,
    /// Not at all
    None,
}

/// Arguments of `export`.
#[derive(Debug, Args)]
pub struct ExportArgs {
    /// A run folder, or its `tape` folder
    pub run: PathBuf,
    /// The format
    #[arg(long)]
    pub to: Format,
    /// The folder to write into [default: `export` in the run folder]
    #[arg(long, short)]
    pub out: Option<PathBuf>,
    /// A stream such as plant.motion, or a field such as plant.motion.position (may be given more than once) [default: everything]
    #[arg(long, value_name = "NAME")]
    pub of: Vec<String>,
    /// Leave out samples before this simulated time
    #[arg(long, value_name = "TIME", value_parser = parse_instant)]
    pub from: Option<Rational>,
    /// Leave out samples after this simulated time
    #[arg(long, value_name = "TIME", value_parser = parse_instant)]
    pub until: Option<Rational>,
    /// The compression of an MCAP file [default: lz4]
    #[arg(long, value_enum)]
    pub compression: Option<CompressionArg>,
    /// A URDF for a body of the scene, instead of that of the scenario (may be given more than once)
    #[arg(long, value_name = "BODY=URDF", value_parser = parse_model)]
    pub model: Vec<(String, PathBuf)>,
    /// Whether a damaged tape is exported
    #[command(flatten)]
    pub seal: SealArgs,
}

impl ExportArgs {
    /// The selected part of the tape.
    fn choice(&self) -> ExcerptSpec {
        ExcerptSpec {
            names: self.of.clone(),
            from: self.from,
            to: self.until,
        }
    }

    fn compression(&self) -> Compression {
        match (self.to, self.compression) {
            // An intermediate file for another format.
            (Format::Rrd, _) | (_, Some(CompressionArg::None)) => Compression::None,
            (_, Some(CompressionArg::Lz4) | None) => Compression::Lz4,
        }
    }

    /// The option that the format has no use for, if one is given.
    fn unused_option(&self) -> Option<&'static str> {
        let scene = matches!(self.to, Format::Mcap | Format::Rrd);
        if self.compression.is_some() && self.to != Format::Mcap {
            return Some("--compression: only a file of --to mcap is compressed this way: leave it out");
        }
        (!self.model.is_empty() && !scene)
            .then_some("--model: only files of --to mcap and rrd have a scene with bodies: leave it out")
    }
}

/// Exports and lists the files; returns the exit code.
pub fn run(args: &ExportArgs) -> anyhow::Result<i32> {
    let start = Instant::now();
    if let Some(reason) = args.unused_option() {
        eprintln!("error: {reason}");
        return Ok(UNREADABLE);
    }
    let chosen = args.out.as_deref();
    chosen.map_or(Ok(()), |out| destination::check("--out", out))?;
    let rerun = (args.to == Format::Rrd).then(|| in_path("rerun"));
    if let Some(None) = rerun {
        eprintln!(
            "error: --to rrd: Rerun's own format changes with Rerun, so Rerun itself must write it, and there is no program `rerun` \
             in PATH (`pip install rerun-sdk` brings it); Rerun also opens the file of --to mcap as it is"
        );
        return Ok(UNREADABLE);
    }
    let reader = match args.seal.open(&args.run) {
        Ok(reader) => reader,
        Err(error) => return Ok(report_read_error(&error)),
    };
    warn_incomplete_records(&reader);
    let out = chosen.map_or_else(|| destination::folder_of(&args.run).join("export"), Path::to_owned);
    let busy = Busy::reading("exporting", &args.run);
    let chosen = match Excerpt::new(&reader, &args.choice()) {
        Ok(chosen) => chosen,
        Err(error) => return Ok(report_read_error(&error)),
    };
    // A file of comma-separated values has no place for it.
    let known = (args.to != Format::Csv)
        .then(|| run_metadata(&args.run, &reader))
        .transpose();
    let (plan, about) = known.map_err(Refusal::of)?.unwrap_or_default();
    let result = match args.to {
        Format::Csv => export::csv(&chosen, &out),
        Format::Parquet => export::parquet(&chosen, &out, &about),
        Format::Mat => {
            let path = out.join("run.mat");
            std::fs::create_dir_all(&out)?;
            export::mat(&chosen, &path, &about).map(|()| vec![path])
        }
        Format::Mcap | Format::Rrd => {
            let scene = scene_of(reader.streams(), &plan, catalogue().views(), &args.model);
            let scene = scene.map_err(Refusal::of)?;
            let path = out.join("run.mcap");
            std::fs::create_dir_all(&out)?;
            export::mcap(&chosen, &path, scene.as_ref(), &about, args.compression()).map(|()| vec![path])
        }
    };
    drop(busy);
    match result {
        Ok(mut files) => {
            if let (Some(Some(rerun)), [mcap]) = (rerun, &files[..]) {
                match convert_to_rerun(&rerun, mcap) {
                    Ok(path) => files.push(path),
                    Err(reason) => {
                        eprintln!("error: {reason}");
                        return Ok(UNWRITABLE);
                    }
                }
            }
            register_outputs(&files);
            for file in &files {
                println!("{}", file.display());
            }
            eprintln!("{} files in {:.2} s", files.len(), start.elapsed().as_secs_f64());
            Ok(0)
        }
        Err(error) => {
            eprintln!("error: {error}");
            Ok(UNWRITABLE)
        }
    }
}

/// Reports why the tape, or the requested part of it, cannot be read; returns the exit code.
fn report_read_error(error: &ReadError) -> i32 {
    let option = match error {
        ReadError::Window { .. } => "--until: ",
        ReadError::Outside { requested, .. } if requested[0].is_none() => "--until: ",
        ReadError::Outside { .. } => "--from: ",
        _ => "",
    };
    eprintln!("error: {option}{}", read_error_text(error));
    UNREADABLE
}

/// Names and values about a run, for the metadata of its exports.
type Metadata = Vec<(&'static str, String)>;

/// The plan of the run, and the available information in its folder: the plan's text, the program, and the digest of its tape.
fn run_metadata(run: &Path, tape: &Reader) -> Result<(toml::Table, Metadata), ReportError> {
    let folder = RunFolder::open(&destination::folder_of(run));
    let PlanFile { text: plan, table } = PlanFile::read(&folder)?;
    let run = read_json(&folder.run())?;
    let text = |found: &serde_json::Value| found.as_str().map_or_else(|| found.to_string(), str::to_owned);
    let found = |from: &serde_json::Value, key: &str| from.get(key).map(text);
    let seed = table.get("seed");
    let seed = seed.map(|seed| seed.as_str().map_or_else(|| seed.to_string(), str::to_owned));
    let known = [
        ("title", found(&run, "title")),
        ("seed", seed),
        ("digest", tape.sealed_digest().map(|digest| digest.to_string())),
        ("version", found(&run, "version")),
        ("started", found(&run, "started")),
        ("command", found(&run, "command")),
        ("plan", Some(plan).filter(|plan| !plan.is_empty())),
    ];
    let known = known.into_iter().filter_map(|(key, value)| Some((key, value?)));
    Ok((table, known.collect()))
}

/// Converts with the installed Rerun, because its format depends on the version that opens it.
fn convert_to_rerun(rerun: &Path, mcap: &Path) -> Result<PathBuf, String> {
    let path = mcap.with_extension("rrd");
    let mut command = Command::new(rerun);
    command.args(["mcap", "convert"]).arg(mcap).arg("-o").arg(&path);
    let converted = command.stdin(Stdio::null()).output();
    let converted = converted.map_err(|error| format!("{} does not start: {error}", rerun.display()))?;
    if converted.status.success() {
        return Ok(path);
    }
    let _ = std::fs::remove_file(&path);
    let words = String::from_utf8_lossy(&converted.stderr);
    Err(format!(
        "{} does not make a recording of {}: {}",
        rerun.display(),
        mcap.display(),
        words.trim()
    ))
}
