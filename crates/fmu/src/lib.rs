//! FMUs (FMI 2.0 and 3.0, co-simulation) as participants.
//!
//! A [`Model`] is an FMU as a file: archive and description, of which nothing runs. [`participant`] makes one that unpacks, loads and
//! steps it. A ZIP archive and a model description come from anybody and are checked; the library in it is code that can do
//! what it likes, so a run gives it a process of its own.

mod abi;
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
pub use description::{
    Abilities, BASE_UNITS, BaseUnit, Causality, Conversion, Description, DescriptionError, Experiment, Extent, Initial,
    Item, Range, Type, Unit, Variability, Variable, Version,
};
pub use draft::{Draft, Names, Part, Wire, together};
pub use inspect::{Inspection, inspect, look, period, written};
pub use layout::{INPUTS, OUTPUTS, RECORDED, element};
pub use model::{FILE_MAX, FmuError, Model};
pub use names::nearest;
pub use participant::{check, participant};
pub use scratch::{FOLDER, leftovers, remove_leftovers};
pub use zip::{Archive, ENTRIES_MAX, Entry, UNPACKED_MAX, ZipError};
