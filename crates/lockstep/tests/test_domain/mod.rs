//! A domain in shared memory for one test, removed at its end.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};

use lockstep::transport::iceoryx::{Address, Domain};

/// A domain of its own, with no other process in it.
pub struct TestDomain {
    pub domain: Domain,
    prefix: String,
    folder: PathBuf,
}

impl TestDomain {
    pub fn new() -> TestDomain {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let next = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("lockstep_test_{}_{next}_", std::process::id());
        let folder = Path::new("/dev/shm").join(format!("folder_{name}"));
        std::fs::create_dir(&folder).expect("shared memory can be written");
        let address = Address {
            prefix: name.clone(),
            folder: folder.clone(),
        };
        TestDomain {
            domain: Domain::enter(address, "test").expect("a new name is free"),
            prefix: name,
            folder,
        }
    }
}

impl Drop for TestDomain {
    fn drop(&mut self) {
        for entry in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().starts_with(&self.prefix) {
                let _ = std::fs::remove_file(entry.path());
            }
        }
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}
