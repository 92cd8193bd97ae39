//! Declared faults: what is done to samples on their way, as a pure function of the scenario and the run's seed.
//!
//! A [`SignalFault`] changes what samples say: where an input reads them, or where an output gives them out. A
//! [`LinkFault`] changes when they are visible, and belongs to [`crate::link::Visibility`]. No participant takes part in
//! either: the steppers do it, after everything that came in has been checked and after everything that goes out is on
//! the tape.

mod declared;
mod injector;
mod slots;

pub use declared::{Effect, LinkFault, Place, SignalFault, Span};
pub use injector::{Disturbance, Injector};
pub use slots::Slot;
