//! The shared library of an FMU: loaded, searched for functions, unloaded.

use std::collections::BTreeSet;
use std::ffi::{CStr, CString, c_int, c_void};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use foreign_calls::{Guard, HelperConflict, check_helpers};

use super::threads;

/// Why an instance cannot be created.
#[derive(Debug, thiserror::Error)]
pub enum LoadError {
    /// The dynamic linker rejects the library.
    #[error("the library cannot be loaded: {0}")]
    Load(String),
    /// It would share a library of its own with another participant.
    #[error("the library cannot be loaded: {0}")]
    Helper(#[from] HelperConflict),
    /// The library embeds Python, which is missing.
    #[error(
        "the library embeds Python, and this machine has no libpython3.N.so.1.0 where libraries are looked for: install it (Debian: \
         libpython3-dev), or name its folder in LD_LIBRARY_PATH ({0})"
    )]
    Python(String),
    /// A function of the standard is missing.
    #[error("the library has no function `{0}`, which the standard asks for")]
    Function(&'static str),
    /// The FMU returned no instance.
    #[error("it could not be instantiated{0}")]
    Instantiate(String),
    /// A folder whose path cannot be represented in C or as a URI.
    #[error("`{}` has a zero byte in it", .0.display())]
    Path(PathBuf),
}

/// A loaded library.
pub(super) struct Library {
    handle: *mut c_void,
    /// The threads that were alive before it was loaded.
    threads: Option<BTreeSet<u64>>,
    /// For the code that the library executes when it is unloaded.
    guard: Guard,
}

fn last_error() -> String {
    // SAFETY: dlerror returns null or a text that stays valid until the next call of dl… in this thread.
    unsafe {
        let text = libc::dlerror();
        if text.is_null() {
            "the dynamic linker does not say why".to_owned()
        } else {
            CStr::from_ptr(text).to_string_lossy().into_owned()
        }
    }
}

/// Whether the symbol that the dynamic linker misses belongs to Python.
fn misses_python(reason: &str) -> bool {
    let symbol = reason.split("undefined symbol: ").nth(1);
    symbol.is_some_and(|symbol| symbol.trim_start_matches('_').starts_with("Py"))
}

fn open(name: &CStr, scope: c_int) -> *mut c_void {
    // SAFETY: the name is zero-terminated. The library's initialisers are the FMU's own code, which is why an FMU gets its
    // own process.
    unsafe { libc::dlopen(name.as_ptr(), libc::RTLD_NOW | scope) }
}

/// Whether one of these functions is in the global scope: a library that is loaded then gets that function in the place of its own, wherever
/// it calls one through its table of linked functions.
fn are_global<'a>(mut functions: impl Iterator<Item = &'a str>) -> bool {
    // SAFETY: a null name stands for the global scope; its handle is never closed, which only counts a reference to the program.
    let global = unsafe { libc::dlopen(std::ptr::null(), libc::RTLD_LAZY) };
    functions.any(|name| {
        // SAFETY: the handle is that of the global scope, and the name ends with a zero byte.
        CString::new(name).is_ok_and(|name| unsafe { !libc::dlsym(global, name.as_ptr()).is_null() })
    })
}

/// Loads the newest Python of this machine for all libraries that are loaded afterwards, and keeps it loaded.
fn load_python() -> bool {
    let names = (8..30)
        .rev()
        .filter_map(|minor| CString::new(format!("libpython3.{minor}.so.1.0")).ok());
    names.into_iter().any(|name| !open(&name, libc::RTLD_GLOBAL).is_null())
}

impl Library {
    /// Loads the library in `path`, whose functions have these names.
    pub(super) fn load(path: &Path, functions: &[&[&str]], guard: Guard) -> Result<Library, LoadError> {
        let name = CString::new(path.as_os_str().as_bytes()).map_err(|_| LoadError::Path(path.to_owned()))?;
        check_helpers(path)?;
        // In a program that is linked with a library that is an FMU too, a call of the FMU's own functions would reach that one's, because the
        // global scope is searched first. With RTLD_DEEPBIND the FMU's own scope is; but not always, because the FMU is then also cut off from
        // an allocator or a sanitizer that the program has put in the place of the C library's, and from the program's C++ run-time library.
        let scope = match are_global(functions.iter().copied().flatten().copied()) {
            true => libc::RTLD_LOCAL | libc::RTLD_DEEPBIND,
            false => libc::RTLD_LOCAL,
        };
        let threads = threads::alive();
        let mut handle = open(&name, scope);
        if handle.is_null() {
            let reason = last_error();
            if !misses_python(&reason) {
                return Err(LoadError::Load(reason));
            }
            // The library embeds Python, and expects the host to have loaded it.
            if !load_python() {
                return Err(LoadError::Python(reason));
            }
            handle = open(&name, scope);
        }
        if handle.is_null() {
            return Err(LoadError::Load(last_error()));
        }
        Ok(Library { handle, threads, guard })
    }

    /// The address of a function.
    pub(super) fn function(&self, name: &'static str) -> Result<*mut c_void, LoadError> {
        let text = CString::new(name).map_err(|_| LoadError::Function(name))?;
        // SAFETY: the library is loaded and the name is zero-terminated.
        let address = unsafe { libc::dlsym(self.handle, text.as_ptr()) };
        if address.is_null() {
            Err(LoadError::Function(name))
        } else {
            Ok(address)
        }
    }
}

impl Drop for Library {
    fn drop(&mut self) {
        // A thread that the FMU has started and not ended, such as one of a pool that waits for work, would go on in code that is not there
        // any more. Whose threads they are cannot be told, so any new one keeps the library. Without new threads it is unloaded: a campaign
        // loads thousands.
        if threads::any_started_since(self.threads.as_ref()) {
            return;
        }
        // SAFETY: the handle is that of dlopen; nothing of the library is used afterwards.
        let close = || unsafe { libc::dlclose(self.handle) };
        self.guard.call("the finalisation of its library", close);
    }
}

/// Declares a struct of the functions of a library, each with its name and C type, and the code that fills it.
macro_rules! functions {
    ($(#[$meta:meta])* $name:ident { $($field:ident = $symbol:literal: fn($($argument:ty),*) $(-> $result:ty)?;)* }) => {
        $(#[$meta])*
        struct $name {
            $($field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl $name {
            const NAMES: &[&str] = &[$($symbol),*];

            fn load(library: &$crate::abi::library::Library) -> Result<$name, $crate::abi::library::LoadError> {
                Ok($name {
                    $($field: {
                        let address = library.function($symbol)?;
                        // SAFETY: the standard defines the type of the function with this name.
                        unsafe {
                            std::mem::transmute::<
                                *mut std::ffi::c_void,
                                unsafe extern "C" fn($($argument),*) $(-> $result)?,
                            >(address)
                        }
                    },)*
                })
            }
        }
    };
}
pub(super) use functions;
