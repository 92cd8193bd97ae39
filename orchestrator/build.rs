//! Finds the commit that the program is built from, for `--version`. Without git, in the sources of an archive that git made, `commit.txt`
//! contains it; without both, the version has no commit.
//!
//! Only a changed source runs this again: a commit alone rebuilds nothing, and the version of a program that was built from changed files ends
//! in `-dirty` until the program is built again from unchanged ones.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Characters of a commit's name.
const SHORT: usize = 12;

fn main() {
    let own = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").expect("cargo names the folder of the manifest"));
    let root = own.parent().expect("the package lies in the project");
    let sources = sources(root);
    for source in &sources {
        println!("cargo::rerun-if-changed={}", source.display());
    }
    let commit = from_git(root, &sources).or_else(|| from_archive(&own.join("commit.txt")));
    let commit = commit.map(|commit| format!(" ({commit})")).unwrap_or_default();
    println!("cargo::rustc-env=ESCAPEMENT_COMMIT={commit}");
    if links_with_lld() {
        // Functions that came out alike become one: the same reading of a table for many types, above all.
        println!("cargo::rustc-link-arg-bins=-Wl,--icf=all");
        if libc_unpacks_relocations() {
            // Addresses that the loader fills in take a bit in place of 24 bytes: 0.8 MB less.
            println!("cargo::rustc-link-arg-bins=-Wl,-z,pack-relative-relocs");
        }
    }
}

/// Whether the C library of this machine, on which the program is built and used, is one that packed relocations need: glibc 2.36 or later.
fn libc_unpacks_relocations() -> bool {
    let output = Command::new("getconf").arg("GNU_LIBC_VERSION").output();
    let text = output.map_or(String::new(), |output| {
        String::from_utf8_lossy(&output.stdout).into_owned()
    });
    let version = text
        .trim()
        .strip_prefix("glibc ")
        .and_then(|version| version.split_once('.'));
    version.is_some_and(|(major, minor)| matches!((major.parse(), minor.parse()), (Ok(2), Ok(36..))))
}

/// Whether Rust's own lld links the program, the default on this target. Other linkers may not know its options.
fn links_with_lld() -> bool {
    let is = |name: &str, value: &str| std::env::var(name).is_ok_and(|actual| actual == value);
    let flags = std::env::var("CARGO_ENCODED_RUSTFLAGS").unwrap_or_default();
    let own = ["linker", "fuse-ld", "link-self-contained"];
    is("TARGET", "x86_64-unknown-linux-gnu")
        && std::env::var_os("RUSTC_LINKER").is_none()
        && !own.iter().any(|word| flags.contains(word))
}

/// What the program is made of: the sources of all packages that it may link.
fn sources(root: &Path) -> Vec<PathBuf> {
    let mut packages: Vec<PathBuf> = ["orchestrator", "plant-proc", "controller-proc", "guidance-proc"]
        .map(|name| root.join(name))
        .into();
    let crates = std::fs::read_dir(root.join("crates")).into_iter().flatten().flatten();
    packages.extend(crates.map(|entry| entry.path()));
    packages.sort();
    let parts = packages
        .iter()
        .flat_map(|package| ["src", "Cargo.toml", "build.rs"].map(|part| package.join(part)));
    let shared = ["Cargo.toml", "Cargo.lock"].map(|name| root.join(name));
    parts.chain(shared).filter(|path| path.exists()).collect()
}

fn git(root: &Path, arguments: &[&str], paths: &[PathBuf]) -> Option<String> {
    let mut git = Command::new("git");
    git.arg("-C").arg(root).arg("--no-optional-locks").args(arguments);
    if !paths.is_empty() {
        git.arg("--").args(paths);
    }
    let output = git.output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}

/// The commit of the repository with this root. An enclosing repository, into which the sources were copied, does not count.
fn from_git(root: &Path, sources: &[PathBuf]) -> Option<String> {
    let top = git(root, &["rev-parse", "--show-toplevel"], &[])?;
    if Path::new(&top).canonicalize().ok()? != root.canonicalize().ok()? {
        return None;
    }
    let commit = git(root, &["rev-parse", &format!("--short={SHORT}"), "HEAD"], &[])?;
    let changed = git(root, &["status", "--porcelain", "--untracked-files=no"], sources)?;
    Some(if changed.is_empty() { commit } else { commit + "-dirty" })
}

/// The commit that `git archive` wrote into the file in place of its own format.
fn from_archive(file: &Path) -> Option<String> {
    let text = std::fs::read_to_string(file).ok()?;
    let commit = text.trim();
    let written = commit.len() >= SHORT && commit.bytes().all(|byte| byte.is_ascii_hexdigit());
    written.then(|| commit[..SHORT].to_owned())
}
