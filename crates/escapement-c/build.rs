//! The name by which programs that are linked with the shared library look for it. It changes with the ABI.

fn main() {
    println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libescapement.so.1");
    println!("cargo::rerun-if-changed=build.rs");
}
