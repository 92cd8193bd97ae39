//! `orchestrator export RUN --to FORMAT`: a tape as files that other tools open.

use std::path::PathBuf;
use std::time::Instant;

use clap::{Args, ValueEnum};
use recorder::export;
use recorder::geometry::Geometry;
use recorder::tape::Reader;

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
    /// One MCAP file with protobuf messages, frame transforms and a scene
    Mcap,
    /// Not written: Rerun opens the MCAP file
    #[value(hide = true)]
    Rrd,
}

/// Write the tape of a run in a format that other tools open.
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
    /// A URDF for the scene, of the servicer or of the target [default: those that the run names]
    #[arg(long)]
    pub model: Vec<PathBuf>,
}

/// Exports and says which files there are; gives the exit code.
pub fn run(args: &ExportArgs) -> anyhow::Result<i32> {
    let start = Instant::now();
    if args.to == Format::Rrd {
        eprintln!(
            "error: --to rrd: this program does not write Rerun's own format, which changes with Rerun; Rerun opens the MCAP \
             file: `orchestrator export {} --to mcap`, then `rerun run.mcap`, or `rerun mcap convert run.mcap -o run.rrd`",
            args.run.display()
        );
        return Ok(UNREADABLE);
    }
    let reader = match Reader::open(&args.run) {
        Ok(reader) => reader,
        Err(error) => {
            eprintln!("error: {error}");
            return Ok(UNREADABLE);
        }
    };
    for torn in reader.torn() {
        eprintln!(
            "note: stream `{}` ends in an incomplete record, which is left out",
            torn.stream
        );
    }
    let out = args.out.clone().unwrap_or_else(|| args.run.join("export"));
    let result = match args.to {
        Format::Csv => export::csv(&reader, &out),
        Format::Parquet => export::parquet(&reader, &out),
        Format::Mcap => {
            let geometry = match Geometry::read(&reader, &args.run, &args.model) {
                Ok(geometry) => geometry,
                Err(error) => {
                    eprintln!("error: {error}");
                    return Ok(UNREADABLE);
                }
            };
            let path = out.join("run.mcap");
            std::fs::create_dir_all(&out)?;
            export::mcap(&reader, &path, Some(&geometry)).map(|()| vec![path])
        }
        Format::Rrd => unreachable!("refused above"),
    };
    match result {
        Ok(files) => {
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
