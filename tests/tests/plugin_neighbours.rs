//! Plug-ins beside others in one process: none changes another one.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use escapement_tests::compiler::NativeBuild;
use escapement_tests::fmus::{helper_library, link_arguments};
use escapement_tests::program::{Folder, digest_anew, run_anew, text};

fn native_build() -> &'static NativeBuild {
    static NATIVE_BUILD: OnceLock<NativeBuild> = OnceLock::new();
    NATIVE_BUILD.get_or_init(|| NativeBuild::new("neighbours"))
}

/// `tests/plugins/misuse.c` as a plug-in.
fn plugin(misuse: &str) -> PathBuf {
    let define = format!("-DMISUSE=\"{misuse}\"");
    native_build().plugin("tests/plugins/misuse.c", &format!("lib{misuse}.so"), &[&define])
}

/// A scenario with these libraries as participants, `one`, `two` and `three`.
fn scenario(folder: &Folder, libraries: &[&Path]) -> PathBuf {
    let mut all = "duration = \"1 s\"\n".to_owned();
    for (name, library) in ["one", "two", "three"].iter().zip(libraries) {
        all += &format!(
            "[participants.{name}]\nperiod = \"10 ms\"\nrun = {{ library = {:?} }}\n",
            text(library)
        );
    }
    folder.write("neighbours.toml", &all)
}

#[test]
fn floating_point_modes_of_a_plugin_are_its_own() {
    let folder = Folder::new("modes");
    let (bad, good) = (plugin("rounds-up"), plugin("nothing"));
    // Twice the same library: it is loaded only once.
    let file = scenario(&folder, &[&bad, &bad, &good]);
    let digest = |how: &[&str]| digest_anew(&folder, &file, how);
    assert_eq!(digest(&["--in-process"]), digest(&[]));
}

#[test]
fn second_helper_library_of_one_name_is_refused_in_one_process() {
    let folder = Folder::new("helpers");
    let build = |version: &str, number| {
        let linked = link_arguments(&helper_library(&native_build().path(version), number));
        let linked = linked.iter().map(String::as_str);
        let arguments: Vec<&str> = ["-DMISUSE=\"nothing\""].into_iter().chain(linked).collect();
        native_build().plugin("tests/plugins/misuse.c", &format!("{version}/libhelped.so"), &arguments)
    };
    let (old, new) = (build("old", 1), build("new", 2));
    // The same library twice has one helper library.
    let twice = scenario(&folder, &[&old, &old]);
    assert_eq!(run_anew(&folder, &twice, &["--in-process"]).code, Some(0));
    let both = scenario(&folder, &[&old, &new]);
    assert_eq!(run_anew(&folder, &both, &[]).code, Some(0));
    let output = run_anew(&folder, &both, &["--in-process"]);
    assert_eq!(output.code, Some(2), "{output:?}");
    for words in [
        "participants.two",
        "new/libescapementhelper.so",
        "old/libescapementhelper.so",
        "leave out --in-process",
    ] {
        assert!(output.err.contains(words), "`{words}`: {output:?}");
    }
}
