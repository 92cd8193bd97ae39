//! Plug-ins: shared libraries that provide tables.

use std::ffi::{CStr, CString, c_void};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use foreign_calls::{Guard, check_helpers};

use crate::LoadError;
use crate::modes;
use crate::table::{self, Plugin, Table};

/// The function that a plug-in exports.
const SYMBOL: &CStr = c"escapement_plugin";
/// The most participants of one library.
const PARTICIPANTS_MAX: u32 = 256;

/// A library that has been loaded. It stays loaded until the process ends, because addresses of its functions may have been kept.
#[derive(Debug, Clone)]
pub struct Library {
    file: PathBuf,
    tables: Vec<&'static Table>,
}

impl Library {
    /// Loads the library in `file` and checks its tables. Loading runs code of the library.
    ///
    /// # Errors
    /// When it is not a library, not for this machine, not a plug-in, or one of another version.
    pub fn open(file: &Path) -> Result<Library, LoadError> {
        crate::look(file)?;
        // A name without a slash would be searched for in the system's library folders.
        let full = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        check_helpers(&full).map_err(|conflict| LoadError::Helper {
            file: file.to_owned(),
            conflict,
        })?;
        let refused = |reason: String| LoadError::Refused {
            remedy: if reason.contains("escapement_participant_main") {
                "compile a plug-in with -DESCAPEMENT_NO_MAIN: a program alone has a main"
            } else {
                "what it needs must be linked with it, and be found by its rpath or LD_LIBRARY_PATH"
            },
            file: file.to_owned(),
            reason,
        };
        let name = CString::new(full.as_os_str().as_bytes()).map_err(|error| refused(error.to_string()))?;
        // What the library's initialisers make of the floating-point modes is for its participants alone.
        let guard = Guard::allowing_exit();
        // SAFETY: the name ends with a zero byte. The user is responsible for the library's own code.
        let open = || unsafe { libc::dlopen(name.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) };
        let handle = guard.call("the initialisation of the library", open);
        if handle.is_null() {
            // SAFETY: the loader's message is valid until the next call of the loader by this thread.
            let reason = unsafe { table::text(libc::dlerror()) }.map_or_else(|| "for no reason".into(), str::to_owned);
            // The loader's message begins with the name, which our message already has.
            let reason = reason
                .strip_prefix(&*format!("{}: ", full.display()))
                .unwrap_or(&reason);
            return Err(refused(reason.to_owned()));
        }
        // SAFETY: the handle is that of a library.
        let symbol = unsafe { libc::dlsym(handle, SYMBOL.as_ptr()) };
        if symbol.is_null() {
            return Err(LoadError::NoPlugin { file: file.to_owned() });
        }
        // SAFETY: a function of this name has this type.
        let plugin = unsafe { std::mem::transmute::<*mut c_void, Plugin>(symbol) };
        let mut tables = Vec::new();
        for number in 0..=PARTICIPANTS_MAX {
            // SAFETY: the function accepts any number.
            let given = guard.call("escapement_plugin", || unsafe { plugin(number) });
            if given.is_null() {
                break;
            }
            // SAFETY: it returns the address of a table, which exists as long as the library: to the end.
            let checked = unsafe { table::check(given) };
            tables.push(checked.map_err(|reason| LoadError::Table {
                file: file.to_owned(),
                number,
                reason,
            })?);
        }
        tables.iter().for_each(|table| modes::keep(table, guard.modes()));
        let library = Library {
            file: file.to_owned(),
            tables,
        };
        match library.tables.len() {
            0 => Err(library.selection_error("has no participant: name one in ESCAPEMENT_PLUGIN(&table)".into())),
            count if count > PARTICIPANTS_MAX as usize => {
                Err(library.selection_error(format!("has more than {PARTICIPANTS_MAX} participants")))
            }
            _ => Ok(library),
        }
    }

    /// The participant called `name`; without a name the only one.
    ///
    /// # Errors
    /// When there is none, or several without a choice; the message names them all.
    pub fn participant(&self, name: Option<&str>) -> Result<&'static Table, LoadError> {
        let names = || {
            let names: Vec<String> = self.tables.iter().map(|table| format!("`{}`", table.name())).collect();
            names.join(", ")
        };
        match (name, self.tables.as_slice()) {
            (None, [only]) => Ok(only),
            (None, _) => Err(self.selection_error(format!(
                "has several participants, {}: choose one with participant = \"NAME\"",
                names()
            ))),
            (Some(name), all) => {
                let found = all.iter().find(|table| table.name() == name);
                found
                    .copied()
                    .ok_or_else(|| self.selection_error(format!("has no participant `{name}`; it has {}", names())))
            }
        }
    }

    fn selection_error(&self, reason: String) -> LoadError {
        LoadError::Which {
            file: self.file.clone(),
            reason,
        }
    }
}
