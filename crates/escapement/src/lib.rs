//! Lockstep co-simulation from Rust: write participants, embed them in your own program, or control runs from code.
//!
//! A complete command-line program with one participant:
//!
//! ```no_run
//! use std::process::ExitCode;
//!
//! use escapement::prelude::*;
//!
//! escapement::message! {
//!     /// How high the lander is.
//!     pub struct Height {
//!         /// Above the ground.
//!         pub height: f64 = "m" in "N",
//!     }
//! }
//!
//! struct Lander(Height);
//!
//! impl Participant for Lander {
//!     fn interface(&self) -> Interface {
//!         Interface::new(Kind::Continuous).output::<Height>("motion")
//!     }
//!     fn initialise(&mut self, _t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
//!         *outputs.get_mut(0) = self.0;
//!         Ok(())
//!     }
//!     fn step(&mut self, step: &Step, _inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
//!         self.0.height -= 1.5 * step.period;
//!         *outputs.get_mut(0) = self.0;
//!         Ok(())
//!     }
//! }
//!
//! fn main() -> ExitCode {
//!     escapement::Program::new("lander")
//!         .participant("lander", |_| Ok(Box::new(Lander(Height { height: 100.0 }))))
//!         .main()
//! }
//! ```
//!
//! The same participant in a run that is controlled from code:
//!
//! ```
//! # use escapement::prelude::*;
//! # escapement::message! {
//! #     /// How high the lander is.
//! #     pub struct Height {
//! #         /// Above the ground.
//! #         pub height: f64 = "m" in "N",
//! #     }
//! # }
//! # struct Lander(Height);
//! # impl Participant for Lander {
//! #     fn interface(&self) -> Interface {
//! #         Interface::new(Kind::Continuous).output::<Height>("motion")
//! #     }
//! #     fn initialise(&mut self, _t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
//! #         *outputs.get_mut(0) = self.0;
//! #         Ok(())
//! #     }
//! #     fn save(&self) -> Option<Vec<u8>> {
//! #         Some(self.0.height.to_le_bytes().to_vec())
//! #     }
//! #     fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
//! #         self.0.height = f64::from_le_bytes(state.try_into()?);
//! #         Ok(())
//! #     }
//! #     fn step(&mut self, step: &Step, _inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
//! #         self.0.height -= 1.5 * step.period;
//! #         *outputs.get_mut(0) = self.0;
//! #         Ok(())
//! #     }
//! # }
//! use std::path::Path;
//! use std::sync::Arc;
//!
//! let catalogue = Catalogue::new("lander 1.0")
//!     .participant("lander", |_| Ok(Box::new(Lander(Height { height: 100.0 }))));
//! let text = r#"
//!     title = "A lander comes down"
//!     duration = "20 s"
//!     [participants.lander]
//!     run = { builtin = "lander" }
//!     period = "10 ms"
//! "#;
//! let scenario = Scenario::read_text(&Arc::new(catalogue), Path::new("lander.toml"), text)?;
//! let options = Options { in_process: true, record: Record::Memory, ..Options::default() };
//!
//! // To the end at once …
//! let outcome = escapement::run(&scenario, &options)?;
//! assert_eq!(outcome.ending, Ending::Complete);
//!
//! // … or from rest to rest.
//! let mut run = Run::start(&scenario, &options)?;
//! run.run_to("2 s")?;
//! let height: Height = run.newest("lander.motion")?.get()?;
//! assert!((height.height - 97.0).abs() < 1e-9);
//! let here = run.save()?;
//! run.run_to("20 s")?;
//! run.restore(&here)?;
//! run.step()?;
//! assert_eq!(run.now().to_string(), "2010 ms");
//! run.run_to("20 s")?;
//! assert_eq!(run.end()?.digest, outcome.digest);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod testing;

pub use engine;
pub use engine::Catalogue;
pub use engine::run::run;
#[doc(hidden)]
pub use fmu_export;
pub use lockstep;
pub use lockstep::{enumeration, message};
pub use orchestrator::{Program, VERSION};
pub use plugin;
pub use tape;

/// Creates the entry points of an FMU library, which `fmu export` of a program packs into the FMUs of the program's own
/// participants.
///
/// Use it in a package with `crate-type = ["cdylib"]`. The library lies next to the program `NAME` as `libNAME_fmu.so`, or
/// is named with `--library`. The argument fills the catalogue, as for [`Program::contents`]; the library may be a plug-in
/// as well.
///
/// ```
/// use escapement::prelude::*;
///
/// fn contents(catalogue: Catalogue) -> Catalogue {
///     catalogue
/// }
///
/// escapement::fmu!(contents);
/// # fn main() {}
/// ```
#[macro_export]
macro_rules! fmu {
    ($contents:path) => {
        $crate::fmu_export::fmu!($contents, $crate::VERSION);
    };
}

/// The items that most participants and programs need.
pub mod prelude {
    pub use engine::Catalogue;
    pub use engine::run::{Checkpoint, Ending, Options, Outcome, Record, Run, RunFailure, Sample};
    pub use engine::scenario::{
        ConnectionSpec, FaultKind, FaultSpec, GuardSpec, MeasureKind, MeasureSpec, OnFailureSpec, ParticipantSpec,
        RecordSpec, RunSpec, Scenario, ScenarioError, ScenarioSpec, Time,
    };
    pub use lockstep::participant::{
        Failure, InputPort, Inputs, Interface, Kind, Log, OutputPort, Outputs, ParameterError, Participant, Ports,
        Setup, Step, Termination, state,
    };
    pub use orchestrator::Program;
}
