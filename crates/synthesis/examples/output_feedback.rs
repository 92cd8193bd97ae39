//! Static output feedback on every problem file of a folder: `cargo run --release -p synthesis --example output_feedback
//! -- FOLDER [STARTS] [NAME…]`. The files are JSON with the keys of `synthesis::matrices::PlantMatrices`, for example those of
//! the COMPleib collection (F. Leibfritz). A file `best.json` in the folder, `{"NAME": gamma, …}`, is compared with.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::PathBuf;
use std::time::Instant;

use synthesis::matrices::PlantMatrices;
use synthesis::tuner::{Options, SearchControl, tune};

fn main() -> Result<(), Box<dyn Error>> {
    let mut args = std::env::args().skip(1);
    let folder = PathBuf::from(args.next().ok_or("usage: output_feedback FOLDER [STARTS] [NAME…]")?);
    let starts = args.next().map_or(Ok(4), |s| s.parse())?;
    let names: Vec<String> = args.collect();
    let best: BTreeMap<String, f64> = match std::fs::read_to_string(folder.join("best.json")) {
        Ok(text) => serde_json::from_str(&text)?,
        Err(_) => BTreeMap::new(),
    };
    let mut files: Vec<PathBuf> = std::fs::read_dir(&folder)?
        .filter_map(|e| e.ok().map(|e| e.path()))
        .collect();
    files.retain(|f| f.extension().is_some_and(|e| e == "json") && f.file_stem().is_some_and(|s| s != "best"));
    files.sort();
    println!(
        "{:8} {:>12} {:>12} {:>8} {:>11} {:>10} {:>6} {:>8}",
        "problem", "gamma", "best known", "ratio", "abscissa", "certif.", "evals", "seconds"
    );
    for file in files {
        let plant: PlantMatrices = serde_json::from_str(&std::fs::read_to_string(&file)?)?;
        if !names.is_empty() && !names.contains(&plant.name) {
            continue;
        }
        let clock = Instant::now();
        let options = Options {
            starts,
            ..Options::default()
        };
        let tuned = plant
            .static_output_feedback()
            .map_err(|e| e.to_string())
            .and_then(|p| tune(&p, &options, &|_| SearchControl::Continue).map_err(|e| e.to_string()));
        let seconds = clock.elapsed().as_secs_f64();
        match tuned {
            Ok(t) => {
                let known = best.get(&plant.name).copied().unwrap_or(f64::NAN);
                println!(
                    "{:8} {:12.6} {known:12.6} {:8.4} {:11.3e} {:10.2e} {:6} {seconds:8.2}   {:.5?}",
                    plant.name,
                    t.evaluation.gamma,
                    t.evaluation.gamma / known,
                    t.evaluation.abscissa,
                    t.certificate.length,
                    t.evaluations,
                    t.starts
                );
            }
            Err(e) => println!("{:8} {e} ({seconds:.2} s)", plant.name),
        }
    }
    Ok(())
}
