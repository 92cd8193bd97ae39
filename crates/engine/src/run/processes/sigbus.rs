//! SIGBUS handling: pages of shared memory that the kernel cannot provide.
//!
//! A page of shared memory is allocated when it is first touched, and if there is none left the kernel sends SIGBUS. What a run
//! needs is checked and reserved before its start, but other programs share the memory. So a program that calls [`guard`] maps a
//! private page where one is missing, and notes that. Nothing that is written to such a page reaches a participant: the run ends at
//! the next check.

use std::io;
use std::sync::Once;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use libc::{MAP_ANONYMOUS, MAP_FAILED, MAP_FIXED, MAP_PRIVATE, PROT_READ, PROT_WRITE, SIG_DFL, SIGBUS};

static MISSED: AtomicBool = AtomicBool::new(false);
static PAGE: AtomicUsize = AtomicUsize::new(4096);

/// Whether a page was missing since the last call.
pub(crate) fn take_missed_page() -> bool {
    MISSED.swap(false, Ordering::Relaxed)
}

/// Handles SIGBUS, once for the whole program: from then on a run in processes ends properly when shared memory is full, where the
/// signal would end the program. For a program with one run at a time; the engine itself handles no signals.
///
/// # Errors
/// When the system refuses the handler.
pub fn guard() -> io::Result<()> {
    static INSTALLED: Once = Once::new();
    let mut installed = Ok(());
    INSTALLED.call_once(|| {
        PAGE.store(page_size(), Ordering::Relaxed);
        // SAFETY: all zeros is a valid value of this plain structure.
        let mut action: libc::sigaction = unsafe { std::mem::zeroed() };
        action.sa_sigaction = at_missing_page as *const () as usize;
        action.sa_flags = libc::SA_SIGINFO;
        // SAFETY: the handler makes two system calls and stores to atomics; it takes no lock and allocates no memory.
        if unsafe { libc::sigaction(SIGBUS, &raw const action, std::ptr::null_mut()) } != 0 {
            installed = Err(io::Error::last_os_error());
        }
    });
    installed
}

/// The size of a page, bytes. The C library knows it; asking the kernel again takes system calls, and fails under a profiler that
/// shows a program another auxiliary vector.
fn page_size() -> usize {
    // SAFETY: the call has no arguments in memory.
    usize::try_from(unsafe { libc::sysconf(libc::_SC_PAGESIZE) }).unwrap_or(4096)
}

extern "C" fn at_missing_page(_: libc::c_int, about: *mut libc::siginfo_t, _: *mut libc::c_void) {
    let size = PAGE.load(Ordering::Relaxed);
    // SAFETY: the kernel passes a valid structure to a handler with SA_SIGINFO.
    let (code, address) = unsafe { ((*about).si_code, (*about).si_addr() as usize) };
    if code == libc::BUS_ADRERR {
        let page = (address & !(size - 1)) as *mut libc::c_void;
        // SAFETY: the address belongs to a mapping of this process, otherwise the signal would be SIGSEGV; a page of zeros replaces
        // the missing one.
        let mapped = unsafe {
            libc::mmap(
                page,
                size,
                PROT_READ | PROT_WRITE,
                MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED,
                -1,
                0,
            )
        };
        if mapped != MAP_FAILED {
            MISSED.store(true, Ordering::Relaxed);
            return;
        }
    }
    // Any other bus error ends the program as usual, when the instruction is tried again.
    // SAFETY: the default action is a valid one.
    unsafe { libc::signal(SIGBUS, SIG_DFL) };
}

#[cfg(test)]
mod tests {
    use std::os::fd::AsRawFd;

    use super::*;

    #[test]
    fn sigbus_handler_replaces_missing_page() {
        guard().expect("a handler");
        let size = page_size();
        let path = std::env::temp_dir().join(format!("escapement-bus-{}", std::process::id()));
        let file = std::fs::File::options()
            .read(true)
            .write(true)
            .create_new(true)
            .open(&path)
            .expect("a file");
        std::fs::remove_file(&path).expect("the file is there");
        file.set_len(1).expect("a page");
        // The second page is beyond the end of the file: the kernel has none for it.
        // SAFETY: a mapping of two pages at an address of the kernel's choice.
        let base = unsafe {
            libc::mmap(
                std::ptr::null_mut(),
                2 * size,
                PROT_READ | PROT_WRITE,
                libc::MAP_SHARED,
                file.as_raw_fd(),
                0,
            )
        };
        assert_ne!(base, MAP_FAILED);
        let byte = |at: usize| base.cast::<u8>().wrapping_add(at);
        // SAFETY: within the mapping, which no other code knows of.
        unsafe {
            byte(1).write_volatile(7);
            assert!(!take_missed_page());
            byte(size + 1).write_volatile(8);
            assert_eq!((byte(1).read_volatile(), byte(size + 1).read_volatile()), (7, 8));
            libc::munmap(base, 2 * size);
        }
        assert!(take_missed_page() && !take_missed_page());
    }
}
