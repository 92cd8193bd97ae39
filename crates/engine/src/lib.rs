//! The engine: a scenario becomes runs, replays and campaigns.
//!
//! - [`scenario`]: the file that a user writes, read and resolved once;
//! - [`run`]: one run, with its participants in one loop or each in a process of its own, to a tape and figures;
//! - [`replay`]: one participant of a recorded run again, with the inputs that it had; [`shadow`]: a second program on a
//!   participant's inputs;
//! - [`measures`]: figures and criteria that a scenario declares;
//! - [`campaign`]: many runs of one scenario with changes, and one table;
//! - [`live`]: a page that shows a run while it goes on, and steers it.
//!
//! The engine is a library: it prints nothing, reads no keys, installs no signal handler and never ends the process. A
//! [`Catalogue`] holds the participants and the assessments that the program contains; an [`Observer`] receives what happens,
//! and an [`Interrupt`] asks for an end in order.

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

pub use observer::{Answer, Event, Interrupt, Observer, Progress, Silent};
