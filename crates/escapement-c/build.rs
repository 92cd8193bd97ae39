//! Sets the soname of the shared library, by which the programs linked with it find it. It changes with the ABI.

fn main() {
    println!("cargo::rustc-cdylib-link-arg=-Wl,-soname,libescapement.so.1");
    println!("cargo::rerun-if-changed=build.rs");
}
