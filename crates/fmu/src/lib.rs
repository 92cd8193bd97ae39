//! FMUs (FMI 2.0 and 3.0, co-simulation) as participants.
//!
//! A [`Model`] is an FMU file: archive and description; none of its code is executed. [`participant`] creates a participant
//! that unpacks, loads and steps it. ZIP archives and model descriptions are untrusted input and are checked; the library
//! in an FMU is native code with all rights of its process, so a run gives it a separate process.
//!
//! # Example
//!
//! ```no_run
//! let model = fmu::Model::open("tank.fmu".as_ref())?;
//! for variable in &model.description.variables {
//!     println!("{}", variable.name);
//! }
//! let inspection = fmu::inspect("tank.fmu".as_ref())?;
//! println!("{}", inspection.scenario);
//! # Ok::<(), fmu::FmuError>(())
//! ```
//!
//! A file that is no FMU is an error that names it:
//!
//! ```
//! let error = fmu::Model::read("tank.fmu".into(), b"no archive".to_vec()).unwrap_err();
//! assert!(error.to_string().contains("tank.fmu"));
//! ```

mod abi;
mod aliases;
mod description;
mod draft;
mod history;
mod inspect;
mod instance;
mod items;
mod layout;
mod model;
mod names;
mod options;
mod participant;
mod scratch;
mod settings;
mod transfer;
mod zip;

pub use abi::to_standard_error;
pub use aliases::Aliases;
pub use description::{
    Alias, BASE_UNITS, BaseUnit, Capabilities, Causality, Conversion, Description, DescriptionError, Experiment,
    Extent, Initial, Item, Range, Type, Unit, Variability, Variable, Version,
};
pub use draft::{Draft, DraftParticipant, Names, VariableConnection, connect_matching};
pub use inspect::{Inspection, check_description, inspect, parameter_entries, suggested_period, suggested_span};
pub use layout::{INPUTS, OUTPUTS, RECORDED, element};
pub use model::{FILE_MAX, FmuError, Model};
pub use names::nearest;
pub use participant::{check, participant};
pub use scratch::{FOLDER, leftovers, remove_leftovers};
pub use zip::{Archive, ENTRIES_MAX, Entry, UNPACKED_MAX, ZipError};
