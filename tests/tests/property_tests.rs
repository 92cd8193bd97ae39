//! Property tests use the same random cases on every machine and leave no file in a checkout.

use std::fs;
use std::path::{Path, PathBuf};

use escapement_tests::program::root;

/// All files below `folder`, without build products and hidden folders.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let (path, name) = (entry.path(), entry.file_name());
        let hidden = name.to_string_lossy().starts_with('.');
        if path.is_dir() && !hidden && name != "target" && name != "runs" {
            files(&path, found);
        } else if path.is_file() {
            found.push(path);
        }
    }
}

#[test]
fn property_tests_have_a_fixed_seed_and_leave_no_file() {
    let value = |name: &str| std::env::var(name).unwrap_or_default();
    let seed = value("PROPTEST_RNG_SEED");
    assert!(
        seed.parse::<u64>().is_ok(),
        "`.cargo/config.toml` sets the seed: {seed:?}"
    );
    assert_ne!(value("PROPTEST_DISABLE_FAILURE_PERSISTENCE"), "");
    let mut all = Vec::new();
    files(&root(), &mut all);
    let words = [concat!("rng_", "seed"), concat!("failure_", "persistence")];
    for path in all {
        let kept = path.components().any(|part| part.as_os_str() == "proptest-regressions");
        assert!(!kept, "a case that failed is a test of its own: {}", path.display());
        if path.extension().is_some_and(|ending| ending == "rs") {
            let text = fs::read_to_string(&path).unwrap();
            let word = words.iter().find(|word| text.contains(**word));
            assert!(word.is_none(), "{}: `.cargo/config.toml` sets {word:?}", path.display());
        }
    }
}
