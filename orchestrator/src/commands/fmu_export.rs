//! `escapement fmu export`: calls the library of FMUs, which packs itself.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::os::unix::ffi::OsStrExt;
use std::path::{Path, PathBuf};

use anyhow::{Context, bail};
use clap::Args;
use toml::{Table, Value};

use crate::{destination, version};

/// Arguments of `fmu export`.
#[derive(Debug, Args)]
pub struct FmuExportArgs {
    /// The scenario
    pub scenario: PathBuf,
    /// The participant: a builtin or a plug-in. Without it the whole scenario becomes one FMU
    #[arg(long, value_name = "NAME")]
    pub participant: Option<String>,
    /// For a whole scenario: the inputs that are inputs of the FMU, each PARTICIPANT.INPUT; they must not be connected
    #[arg(long, value_name = "PORT", value_delimiter = ',', conflicts_with = "participant")]
    pub inputs: Vec<String>,
    /// For a whole scenario: the outputs that are outputs of the FMU, each PARTICIPANT.OUTPUT; by default all
    #[arg(long, value_name = "PORT", value_delimiter = ',', conflicts_with = "participant")]
    pub outputs: Vec<String>,
    /// For a whole scenario: keep no history; the FMU cannot save its state then, and its memory does not grow
    #[arg(long, conflicts_with = "participant")]
    pub stateless: bool,
    /// The version of the standard: 2 or 3
    #[arg(long, default_value = "2", value_parser = ["2", "3"])]
    pub fmi: String,
    /// The file to write; by default NAME.fmu in the current folder
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Change a key of the scenario, such as participants.plant.parameters.slosh=none
    #[arg(long, value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// The library for the FMU, if it is not in the folder of this program
    #[arg(long, value_name = "FILE")]
    pub library: Option<PathBuf>,
}

type OutputCallback = unsafe extern "C" fn(*mut c_void, c_int, *const c_char);
type Export = unsafe extern "C" fn(*const c_char, *mut c_void, OutputCallback) -> c_int;

/// Exports.
pub fn run(args: &FmuExportArgs) -> anyhow::Result<i32> {
    let out = args.out.as_deref();
    out.map_or(Ok(()), |out| destination::check("--out", out))?;
    let library = match &args.library {
        Some(file) => std::path::absolute(file)?,
        None => library_beside_program()?,
    };
    let path = |path: &Path| {
        path.to_str()
            .map(|text| Value::String(text.to_owned()))
            .context("a path that is not UTF-8")
    };
    let mut request = Table::new();
    request.insert("version".into(), Value::String(version::ESCAPEMENT.into()));
    request.insert("scenario".into(), path(&args.scenario)?);
    request.insert("library".into(), path(&library)?);
    request.insert("fmi".into(), Value::Integer(args.fmi.parse()?));
    if let Some(out) = &args.out {
        request.insert("out".into(), path(out)?);
    }
    if let Some(name) = &args.participant {
        request.insert("participant".into(), Value::String(name.clone()));
    }
    for (key, all) in [("set", &args.set), ("inputs", &args.inputs), ("outputs", &args.outputs)] {
        request.insert(key.into(), texts(all));
    }
    request.insert("stateless".into(), Value::Boolean(args.stateless));
    export(&library, &request.to_string())
}

fn texts(all: &[String]) -> Value {
    Value::Array(all.iter().cloned().map(Value::String).collect())
}

/// The path of this program's library: next to it, or in `lib` next to its `bin`.
fn library_beside_program() -> anyhow::Result<PathBuf> {
    let own = std::env::current_exe().context("this program's own file")?;
    let (folder, stem) = (
        own.parent().unwrap_or(Path::new("/")),
        own.file_stem().unwrap_or_default(),
    );
    let name = format!("lib{}_fmu.so", stem.to_string_lossy().replace('-', "_"));
    let places = [folder.join(&name), folder.join("../lib").join(&name)];
    if let Some(found) = places.iter().find(|place| place.is_file()) {
        return Ok(found.clone());
    }
    bail!(
        "there is no `{}`, the library that goes into every FMU: put it there, or name it with --library (that of `escapement` is built with \
         `cargo build --release -p escapement-fmu`)",
        places[0].display()
    )
}

unsafe extern "C" fn print(_: *mut c_void, error: c_int, text: *const c_char) {
    // SAFETY: the library returns a text.
    let text = unsafe { CStr::from_ptr(text) }.to_string_lossy();
    if error == 0 {
        println!("{text}");
    } else {
        eprintln!("error: {text}");
    }
}

fn export(library: &Path, request: &str) -> anyhow::Result<i32> {
    let name = CString::new(library.as_os_str().as_bytes())?;
    let request = CString::new(request)?;
    // SAFETY: the name is a text. The library is this program's own, or one that the user names.
    let handle = unsafe { libc::dlopen(name.as_ptr(), libc::RTLD_NOW | libc::RTLD_LOCAL) };
    if handle.is_null() {
        // SAFETY: after a failure dlerror returns a message.
        let reason = unsafe { CStr::from_ptr(libc::dlerror()) }
            .to_string_lossy()
            .into_owned();
        bail!("`{}` cannot be loaded: {reason}", library.display());
    }
    // SAFETY: the handle is that of a loaded library.
    let symbol = unsafe { libc::dlsym(handle, c"escapement_fmu_export".as_ptr()) };
    if symbol.is_null() {
        bail!(
            "`{}` is not a library of FMUs: it has no function `escapement_fmu_export`",
            library.display()
        );
    }
    // SAFETY: the function of this name has this type; the texts outlive the call.
    Ok(unsafe {
        let export = std::mem::transmute::<*mut c_void, Export>(symbol);
        export(request.as_ptr(), std::ptr::null_mut(), print)
    })
}
