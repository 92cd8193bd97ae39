//! Declared faults: changes to samples between producer and consumer, as a pure function of the scenario and the run's seed.
//!
//! A [`SignalFault`] changes the values of samples: where an input reads them, or where an output sends them. A [`LinkFault`] changes
//! when they are visible, and belongs to [`crate::link::DeliveryRule`]. No participant is involved in either: the steppers apply them,
//! after everything received has been checked and after everything sent has been recorded on the tape.

mod declared;
mod injector;
mod slots;

pub use declared::{Effect, FaultPort, FaultWindow, LinkFault, SignalFault};
pub use injector::{Injector, ScheduledSignalFault};
pub use slots::Slot;
