//! Templates of `escapement new`. Their files are embedded in the program: the sources that it was built from are not read.

#[cfg(feature = "capture")]
mod fmu;
mod project;
#[cfg(feature = "capture")]
mod rust;

#[cfg(feature = "capture")]
use project::File;
pub use project::{Project, Template};

#[cfg(feature = "capture")]
/// Files of the project's own tree, with the same paths.
macro_rules! stock_files {
    ($($path:literal)*) => { vec![$(File::new($path, include_str!(concat!("../../../", $path)))),*] };
}

#[cfg(feature = "capture")]
/// The templates of the stock program; the first is the default.
pub const STOCK: [Template; 4] = [
    Template {
        name: "capture",
        about: "all stock scenarios of the spacecraft capture, with models and gains",
        builds: false,
        takes_files: false,
        files: capture,
        next: &[
            "escapement run scenarios/close.toml --out runs/close",
            "escapement report runs/close",
            "escapement check scenarios/realistic.toml",
        ],
    },
    Template {
        name: "spring",
        about: "two coupled masses on springs: the smallest scenario, with participants that the program contains",
        builds: false,
        takes_files: false,
        files: spring,
        next: &[
            "escapement run spring.toml --out runs/first",
            "escapement report runs/first",
            "escapement sweep spring.toml --vary connections.to-right.delay=0ms..50ms:10ms",
        ],
    },
    Template {
        name: "fmu",
        about: "a scenario of FMUs that you name: FOLDER --template fmu a.fmu b.fmu, connected where names and units fit",
        builds: false,
        takes_files: true,
        files: fmu::files,
        next: &[
            "escapement check scenario.toml",
            "escapement run scenario.toml --out runs/first",
            "escapement report runs/first",
        ],
    },
    Template {
        name: "rust",
        about: "a program of your own in Rust with the whole command line, and two participants in it",
        builds: true,
        takes_files: false,
        files: rust::files,
        next: &[
            "cargo run --release -- run lander.toml",
            "cargo run --release -- sweep lander.toml --vary connections.motion.delay=0ms..400ms:100ms",
        ],
    },
];

#[cfg(feature = "capture")]
fn capture(_: &Project<'_>) -> Result<Vec<File>, String> {
    let mut files = vec![File::new("README.md", include_str!("capture.md"))];
    files.extend(stock_files!(
        "campaigns/dispersed-captures.toml"
        "campaigns/rare-miss.toml"
        "gains/closed-loop.toml"
        "gains/p-diagonal.spec.toml"
        "gains/p-diagonal.toml"
        "gains/pi-block.spec.toml"
        "gains/pi-block.toml"
        "gains/pi-diagonal-five.spec.toml"
        "gains/pi-diagonal-five.toml"
        "gains/pi-diagonal.spec.toml"
        "gains/pi-diagonal.toml"
        "gains/pi-full.spec.toml"
        "gains/pi-full.toml"
        "gains/pi-scheduled.spec.toml"
        "gains/pi-scheduled.toml"
        "gains/start.toml"
        "models/servicer-large-tank.urdf"
        "models/servicer-still.toml"
        "models/servicer.toml"
        "models/servicer.urdf"
        "models/target.toml"
        "scenarios/capture-and-stabilise.toml"
        "scenarios/close-start-gains.toml"
        "scenarios/close.toml"
        "scenarios/far-start-gains.toml"
        "scenarios/far.toml"
        "scenarios/fast-tumble.toml"
        "scenarios/joint-ranges.toml"
        "scenarios/realistic.toml"
        "scenarios/reference-close-replanned.toml"
        "scenarios/reference-close.toml"
        "scenarios/reference-far-replanned.toml"
        "scenarios/reference-far.toml"
        "scenarios/slosh-large.toml"
        "scenarios/slosh-off.toml"
        "scenarios/slow-controller.toml"
        "scenarios/unwinding.toml"
        "scenarios/weak-wheels.toml"
        "scenarios/wheel-unloading.toml"
    ));
    Ok(files)
}

#[cfg(feature = "capture")]
fn spring(_: &Project<'_>) -> Result<Vec<File>, String> {
    Ok(vec![File::new("spring.toml", include_str!("spring.toml"))])
}
