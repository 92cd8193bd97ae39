//! Template of a user's program in Rust: the sources of `examples/lander` with a manifest that refers to Escapement.

use std::path::{Path, PathBuf};

use super::{File, Project};

/// The root of the sources that this program was built from.
const BUILT_FROM: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/..");

/// Names that a package cannot have here: those of the crates that it links, and of Rust's own crates.
const RESERVED_NAMES: [&str; 17] = [
    "alloc",
    "core",
    "crate",
    "engine",
    "escapement",
    "fn",
    "impl",
    "lockstep",
    "main",
    "orchestrator",
    "report",
    "self",
    "serde",
    "std",
    "super",
    "tape",
    "test",
];

pub(super) fn files(project: &Project<'_>) -> Result<Vec<File>, String> {
    let name = package_name(&project.name);
    let (dependency, lock) = escapement(project.escapement, Path::new(BUILT_FROM))?;
    let manifest = include_str!("rust.Cargo.toml")
        .replace("PACKAGE", &name)
        .replace("DEPENDENCY", &dependency);
    let own = format!("Program::new(\"{name}\")");
    let main = include_str!("../../../examples/lander/src/main.rs")
        .replace("Program::new(\"lander\")", &own)
        .replace("--release -p lander --", "--release --")
        .replace("examples/lander/lander.toml", "lander.toml");
    let mut files = vec![
        File::new("Cargo.toml", manifest),
        File::new(".gitignore", "/target\n/runs\n"),
        File::new("lander.toml", include_str!("../../../examples/lander/lander.toml")),
        File::new("src/main.rs", main),
        File::new(
            "src/autopilot.rs",
            include_str!("../../../examples/lander/src/autopilot.rs"),
        ),
        File::new("src/lander.rs", include_str!("../../../examples/lander/src/lander.rs")),
        File::new(
            "src/messages.rs",
            include_str!("../../../examples/lander/src/messages.rs"),
        ),
    ];
    if cfg!(all(target_arch = "x86_64", target_feature = "avx2")) {
        files.push(File::new(".cargo/config.toml", include_str!("rust.config.toml")));
    }
    // The versions that Escapement was tested with. Cargo removes unused entries.
    files.extend(lock.map(|lock| File::new("Cargo.lock", lock)));
    Ok(files)
}

/// The value of `escapement =` in the manifest, and Escapement's own lock file where it can be read.
fn escapement(option: Option<&str>, built_from: &Path) -> Result<(String, Option<String>), String> {
    if let Some(url) = option.filter(|option| option.contains("://") || option.starts_with("git@")) {
        return Ok((format!("{{ git = {} }}", toml::Value::from(url)), None));
    }
    let (root, origin) = match option {
        Some(option) => (PathBuf::from(option), format!("--escapement {option}")),
        None => (
            built_from.to_owned(),
            format!(
                "the sources that this program was built from are no longer in {}",
                shown(built_from)
            ),
        ),
    };
    let root = if root.ends_with("crates/escapement") {
        root.join("../..")
    } else {
        root
    };
    let whole = root.canonicalize().ok();
    match whole.filter(|root| root.join("crates/escapement/Cargo.toml").is_file()) {
        Some(root) => {
            let path = root.join("crates/escapement").display().to_string();
            let lock = std::fs::read_to_string(root.join("Cargo.lock")).ok();
            Ok((format!("{{ path = {} }}", toml::Value::from(path)), lock))
        }
        None if option.is_some() => Err(format!(
            "{origin}: there is no crates/escapement/Cargo.toml in that folder; name a checkout of Escapement, or the address of its \
             repository (https://…, ssh://… or file://…)"
        )),
        None => Err(format!(
            "{origin}: name a checkout with --escapement FOLDER, or the repository with --escapement URL"
        )),
    }
}

/// The path with a trailing parent step resolved.
fn shown(path: &Path) -> String {
    let real = path.parent().filter(|_| path.ends_with("..")).and_then(Path::parent);
    real.unwrap_or(path).display().to_string()
}

/// A valid package name that is as close as possible to `name`.
fn package_name(name: &str) -> String {
    let plain = |c: char| {
        if c.is_ascii_alphanumeric() || c == '_' {
            c.to_ascii_lowercase()
        } else {
            '-'
        }
    };
    let name: String = name.chars().map(plain).collect();
    let name = name.trim_matches('-');
    if name.is_empty() || RESERVED_NAMES.contains(&name) || name.starts_with(|c: char| c.is_ascii_digit()) {
        return format!("sim-{name}").trim_end_matches('-').to_owned();
    }
    name.to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn package_name_derives_from_folder() {
        for (folder, package) in [
            ("lander", "lander"),
            ("My Sim", "my-sim"),
            ("2nd_try", "sim-2nd_try"),
            ("escapement", "sim-escapement"),
            ("test", "sim-test"),
            ("Übung", "bung"),
            ("...", "sim"),
        ] {
            assert_eq!(package_name(folder), package, "{folder}");
        }
    }

    #[test]
    fn missing_sources_are_named_with_remedy() {
        let refused = escapement(None, Path::new("/nowhere/orchestrator/..")).unwrap_err();
        assert!(
            refused.contains("no longer in /nowhere:") && refused.contains("--escapement FOLDER"),
            "{refused}"
        );
        let refused = escapement(Some("/nowhere"), Path::new(BUILT_FROM)).unwrap_err();
        assert!(refused.starts_with("--escapement /nowhere: there is no"), "{refused}");
        let (git, lock) = escapement(Some("https://host/x.git"), Path::new("/nowhere")).unwrap();
        assert_eq!((git.as_str(), lock), ("{ git = \"https://host/x.git\" }", None));
    }
}
