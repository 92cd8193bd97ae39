//! Compiles the one function that must be C: the logger of FMI 2.0 takes a variable number of arguments.

fn main() {
    println!("cargo::rerun-if-changed=src/abi/logger.c");
    cc::Build::new()
        .file("src/abi/logger.c")
        .compile("escapement_fmu_logger");
}
