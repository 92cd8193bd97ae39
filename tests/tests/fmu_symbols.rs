//! FMUs in a program that has functions of the standard itself. The functions are in the global scope of this process, so no other test is
//! in this file.

use std::ffi::CString;
use std::process::Command;

use escapement_tests::compiler::run_checked;
use escapement_tests::fmus::TestFmu;
use escapement_tests::program::{Folder, root, text};
use lockstep::participant::{Inputs, Outputs, Setup, Step};

#[test]
fn fmu_calls_its_own_functions_and_not_those_of_the_program() {
    let folder = Folder::new("symbols");
    let stranger = folder.path().join("stranger.so");
    run_checked(
        Command::new("cc")
            .args(["-shared", "-fPIC", "-o", text(&stranger)])
            .arg(root().join("tests/fmus/stranger.c")),
    );
    let name = CString::new(text(&stranger)).expect("a path has no zero byte");
    // SAFETY: the library has no code that is executed when it is loaded.
    assert!(!unsafe { libc::dlopen(name.as_ptr(), libc::RTLD_NOW | libc::RTLD_GLOBAL) }.is_null());
    for version in [2, 3] {
        let file = TestFmu {
            fault: "CALLS_ITSELF",
            ..TestFmu::new(version)
        }
        .build(&folder, &format!("self-{version}"));
        let setup = Setup {
            name: "it".into(),
            parameters: toml::Table::new(),
            seed: 1,
            period: 0.01,
            offset: 0.0,
        };
        let mut it = fmu::participant(&file, "", &setup, false).expect("it is healthy");
        let interface = it.interface();
        let (inputs, mut outputs) = (Inputs::zeroed(&interface), Outputs::zeroed(&interface));
        it.initialise(0.0, &mut outputs).expect("it starts");
        let step = Step {
            index: 0,
            t: 0.0,
            t_next: 0.01,
            period: 0.01,
        };
        it.step(&step, &inputs, &mut outputs).expect("it steps");
    }
}
