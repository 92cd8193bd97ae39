//! Lockstep co-simulation from Rust: write participants, put them into a program of your own, or drive runs from code.
//!
//! A program with the whole command line and a participant inside:
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
//! The same participant in a run that is driven from code:
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
//! #     fn step(&mut self, step: &Step, _inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
//! #         self.0.height -= 1.5 * step.period;
//! #         *outputs.get_mut(0) = self.0;
//! #         Ok(())
//! #     }
//! # }
//! use std::path::Path;
//! use std::sync::Arc;
//!
//! use escapement::engine::run::{self, Ending, Options};
//! use escapement::engine::scenario::Scenario;
//! use escapement::tape::{Reader, Source};
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
//! let out = std::env::temp_dir().join(format!("lander-{}", std::process::id()));
//! let options = Options { in_process: true, out: Some(out.clone()), ..Options::default() };
//! let outcome = run::run(&scenario, &options)?;
//! assert_eq!(outcome.ending, Ending::Complete);
//! let tape = Reader::open(&outcome.folder)?;
//! assert_eq!(tape.count(0), 2001);
//! # std::fs::remove_dir_all(out)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub use engine;
pub use engine::Catalogue;
pub use lockstep;
pub use lockstep::message;
pub use orchestrator::Program;
pub use plugin;
pub use tape;

/// Everything that a participant and a program mostly need.
pub mod prelude {
    pub use engine::Catalogue;
    pub use lockstep::participant::{
        Failure, Inputs, Interface, Kind, Outputs, ParameterError, Participant, Setup, Step,
    };
    pub use orchestrator::Program;
}
