//! `escapement compare A B`: bitwise comparison of two tapes.

use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use tape::Reader;
use tape::compare::{Comparison, compare};

use super::seal::{SealArgs, read_error_text};
use crate::output;

/// Exit code: the tapes differ.
pub(super) const DIFFERENT: i32 = 3;
/// Exit code: a folder is not a tape, or cannot be read.
const UNREADABLE: i32 = 2;

/// Arguments of `compare`.
#[derive(Debug, Args)]
pub struct CompareArgs {
    /// A run folder, or its `tape` folder
    pub a: PathBuf,
    /// Another run folder, or its `tape` folder
    pub b: PathBuf,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
    /// Whether damaged tapes are compared
    #[command(flatten)]
    pub seal: SealArgs,
}

/// Compares and prints; returns the exit code.
pub fn run(args: &CompareArgs) -> anyhow::Result<i32> {
    let tapes = open(&args.a, args.seal).and_then(|a| Ok((a, open(&args.b, args.seal)?)));
    let comparison = match tapes.and_then(|(a, b)| compare(&a, &b)) {
        Ok(comparison) => comparison,
        Err(error) => {
            eprintln!("error: {}", read_error_text(&error));
            return Ok(UNREADABLE);
        }
    };
    let mut out = output::stdout();
    if args.json {
        serde_json::to_writer_pretty(&mut out, &comparison)?;
        writeln!(out)?;
    } else {
        print(&mut out, &comparison)?;
    }
    Ok(if comparison.identical { 0 } else { DIFFERENT })
}

fn open(path: &Path, seal: SealArgs) -> Result<Reader, tape::ReadError> {
    let reader = seal.open(path)?;
    for torn in reader.incomplete_records() {
        eprintln!(
            "note: {}: stream `{}` ends in {} bytes of an incomplete record after {} complete ones; they are left out",
            path.display(),
            torn.stream,
            torn.bytes,
            torn.complete
        );
    }
    Ok(reader)
}

/// The result as text.
pub(crate) fn print(out: &mut impl Write, comparison: &Comparison) -> io::Result<()> {
    if comparison.identical && comparison.samples == 0 {
        return writeln!(out, "identical, but neither tape has a sample: nothing was compared");
    }
    if comparison.identical {
        return writeln!(out, "identical: {} samples", comparison.samples);
    }
    writeln!(out, "different")?;
    for difference in &comparison.streams {
        writeln!(out, "  {difference}")?;
    }
    let Some(first) = &comparison.first else {
        return writeln!(out, "  the {} samples that both have are equal", comparison.samples);
    };
    writeln!(
        out,
        "  first at {:?} s: {} sample {}, {}: {} against {} {} (bits {} and {})",
        first.stamp_s,
        first.stream,
        first.index,
        first.element,
        first.a.value,
        first.b.value,
        first.unit,
        first.a.bits,
        first.b.bits
    )?;
    let width = comparison
        .fields
        .iter()
        .map(|field| field.field.len())
        .max()
        .unwrap_or(0);
    for field in &comparison.fields {
        writeln!(
            out,
            "  {:width$}  largest difference {:.3e} {} ({} at {:?} s), {} samples",
            field.field, field.largest, field.unit, field.element, field.stamp_s, field.samples
        )?;
    }
    Ok(())
}
