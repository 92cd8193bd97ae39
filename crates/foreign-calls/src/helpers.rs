//! Helper libraries: the shared libraries in the folder of a library that it needs.
//!
//! The dynamic linker knows a needed library by its name alone. Where one of that name is loaded already, also from another folder, a second
//! library gets that one: it then shares static variables with a stranger, or calls functions of another version.

use std::collections::BTreeSet;
use std::ffi::{CStr, OsStr, c_char, c_void};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use crate::elf::needed;

/// The run-time libraries of languages, which are the same for all: their names up to the version.
const RUNTIMES: [&str; 12] = [
    "libc.so",
    "libm.so",
    "libdl.so",
    "librt.so",
    "libpthread.so",
    "libstdc++.so",
    "libgcc_s.so",
    "libgomp.so",
    "libgfortran.so",
    "libquadmath.so",
    "ld-linux",
    "linux-vdso.so",
];

/// Two helper libraries of one name, of which a process can load only one.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "it needs its own `{}`, and this process has loaded another library of that name, `{}`: the dynamic linker would give it that one. Give \
     each participant a process of its own: leave out --in-process",
    own.display(), loaded.display()
)]
pub struct HelperConflict {
    /// The helper library in the folder of the library.
    pub own: PathBuf,
    /// The one that is loaded.
    pub loaded: PathBuf,
}

/// Checks that the dynamic linker will give the library in `file` its own helper libraries, and these theirs. Loads nothing.
///
/// # Errors
/// The first one for which it would not.
pub fn check_helpers(file: &Path) -> Result<(), HelperConflict> {
    let (mut seen, mut next) = (BTreeSet::new(), vec![file.to_owned()]);
    while let Some(library) = next.pop() {
        for name in needed(&library) {
            let name = name.as_c_str();
            if name.to_bytes().contains(&b'/') || is_runtime(name) {
                continue;
            }
            let own = library.with_file_name(OsStr::from_bytes(name.to_bytes()));
            if !own.is_file() || !seen.insert(own.clone()) {
                continue;
            }
            if let Some(loaded) = loaded_from(name).filter(|loaded| is_another(loaded, &own)) {
                return Err(HelperConflict { own, loaded });
            }
            next.push(own);
        }
    }
    Ok(())
}

fn is_runtime(name: &CStr) -> bool {
    RUNTIMES.iter().any(|one| name.to_bytes().starts_with(one.as_bytes()))
}

/// Whether `loaded` is a file, and another one than `own`. A library whose file is gone was unpacked for an instance that is gone too, and
/// could not be unloaded: no participant of this process uses it.
fn is_another(loaded: &Path, own: &Path) -> bool {
    let identity = |path: &Path| std::fs::metadata(path).map(|about| (about.dev(), about.ino()));
    match (identity(loaded), identity(own)) {
        (Ok(loaded), Ok(own)) => loaded != own,
        _ => false,
    }
}

/// The beginning of the C library's `struct link_map`.
#[repr(C)]
struct LinkMap {
    address: usize,
    name: *const c_char,
}

/// The file from which a library called `name` is loaded in this process.
fn loaded_from(name: &CStr) -> Option<PathBuf> {
    // SAFETY: the name ends with a zero byte. With RTLD_NOLOAD nothing is loaded, so no code of a library is executed.
    let handle = unsafe { libc::dlopen(name.as_ptr(), libc::RTLD_NOLOAD | libc::RTLD_LAZY) };
    if handle.is_null() {
        return None;
    }
    let mut map: *const LinkMap = std::ptr::null();
    // SAFETY: the handle is that of a loaded library, and the request writes one pointer to a `struct link_map`, which lives as long as the
    // library is loaded: until after the name has been copied. The handle is not used after it is closed.
    let path = unsafe {
        let found = libc::dlinfo(handle, libc::RTLD_DI_LINKMAP, (&raw mut map).cast::<c_void>());
        let path = (found == 0 && !map.is_null() && !(*map).name.is_null())
            .then(|| CStr::from_ptr((*map).name).to_bytes().to_vec());
        libc::dlclose(handle);
        path
    };
    path.map(|path| PathBuf::from(OsStr::from_bytes(&path)))
}
