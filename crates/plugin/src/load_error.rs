//! Why a library provides no participant.

use std::path::PathBuf;

use foreign_calls::HelperConflict;

use crate::table::TableError;

/// Why a library provides no participant.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum LoadError {
    /// It is not a shared library.
    #[error("`{}` is not a shared library: {reason}", file.display())]
    NoLibrary {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// It is one for another machine.
    #[error("`{}` is a library for {found}, and this program is for {own}: compile it for this machine", file.display())]
    Machine {
        /// The file.
        file: PathBuf,
        /// Its machine.
        found: String,
        /// This machine.
        own: &'static str,
    },
    /// The system's loader rejects it.
    #[error("the library `{}` cannot be loaded: {reason}; {remedy}", file.display())]
    Refused {
        /// The file.
        file: PathBuf,
        /// The loader's message.
        reason: String,
        /// What can be done.
        remedy: &'static str,
    },
    /// It would share a library of its own with another participant.
    #[error("the library `{}` cannot be loaded: {conflict}", file.display())]
    Helper {
        /// The file.
        file: PathBuf,
        /// The two libraries.
        conflict: HelperConflict,
    },
    /// It is a library for another purpose.
    #[error(
        "the library `{}` is no plug-in: it has no function `escapement_plugin`; end its source with ESCAPEMENT_PLUGIN(&table) of \
         escapement.h, or with plugin::export! in Rust, and keep the symbol visible",
        file.display()
    )]
    NoPlugin {
        /// The file.
        file: PathBuf,
    },
    /// One of its tables is invalid.
    #[error("the library `{}`, participant number {}: {reason}", file.display(), .number + 1)]
    Table {
        /// The file.
        file: PathBuf,
        /// Which table, from 0.
        number: u32,
        /// What is wrong with it.
        reason: TableError,
    },
    /// It has no such participant, or several without a choice.
    #[error("the library `{}` {reason}", file.display())]
    Which {
        /// The file.
        file: PathBuf,
        /// What it provides.
        reason: String,
    },
}
