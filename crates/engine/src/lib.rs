//! The engine: turns a scenario into runs, replays and campaigns.
//!
//! - [`scenario`]: the file that a user writes, read and resolved once;
//! - [`run`]: one run, with its participants in one loop or each in its own process, recorded on a tape and reduced to figures;
//! - [`replay`]: replay of one participant of a recorded run, with its recorded inputs; [`shadow`]: a second program on a
//!   participant's inputs;
//! - [`measures`]: figures and criteria that a scenario declares;
//! - [`campaign`]: many runs of one scenario with changes, and one table;
//! - [`live`]: a page that shows a run while it is under way, and controls it.
//!
//! The engine is a library: it prints nothing, reads no keys, installs no signal handler and never ends the process. A
//! [`Catalogue`] holds the participants and the assessments that the program contains; an [`Observer`] receives events, and an
//! [`Interrupt`] requests an orderly end.

pub mod assessment;
mod builtins;
pub mod campaign;
mod catalogue;
pub mod live;
pub mod measures;
mod observer;
pub mod processor;
pub mod replay;
pub mod run;
pub mod scenario;
pub mod scope;
pub mod shadow;
mod text;

pub use builtins::{AssessmentFactory, Builtins, HasBuiltins};
pub use catalogue::{Catalogue, Finding};
pub use report::{scene, view};

pub use observer::{Event, Interrupt, Observer, PauseDecision, Progress, Silent};
pub use text::{check_title, three_digits};
