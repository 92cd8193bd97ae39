//! Participants and scenarios as FMUs, FMI 2.0 and 3.0 for co-simulation.
//!
//! One shared library has the functions of both versions, and everything that runs in FMUs: [`fmu!`] defines it from a program's
//! catalogue. [`export()`] packs it with a model description and a scenario. When an importer loads it, the library reads that scenario
//! and steps one participant of it, or the whole scenario, without an orchestrator and without shared memory.
//!
//! - [`manifest`](crate::Manifest): the content of the resources; `model`: builds what runs from them;
//! - `variable`, `parameter`, `kind`, `unit`: the importer's view; `describe`: that view as XML;
//! - `body`: what is stepped: `single`, one participant, or `whole`, a scenario;
//! - `instance`: the life cycle of an instance; `fmi2`, `fmi3`, `call`: the C functions.

mod body;
#[doc(hidden)]
pub mod call;
#[doc(hidden)]
pub mod command;
mod describe;
mod export;
#[doc(hidden)]
pub mod fmi2;
#[doc(hidden)]
pub mod fmi3;
mod functions;
mod instance;
mod kind;
mod lines;
mod log;
mod manifest;
mod model;
mod pack;
mod parameter;
mod refusal;
mod single;
mod unit;
mod usage;
mod variable;
mod whole;

pub use body::exact;
pub use command::Say;
pub use export::{ExportError, Request, export};
pub use manifest::Manifest;

/// For the functions that [`fmu!`] defines.
#[doc(hidden)]
pub mod __private {
    pub use std::ffi::{c_char, c_int, c_void};
    pub use std::sync::{Arc, OnceLock};

    pub use engine::Catalogue;

    pub use crate::call::{self, Pointer};
    pub use crate::command::{self, Say};
    pub use crate::kind::Native;
    pub use crate::log::LoggerFmi3;
    pub use crate::{fmi2, fmi3};
}
