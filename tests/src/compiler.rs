//! Participants in C and C++, built as a user builds them: against what `install.sh` installs.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use crate::program::{built, root, text};

/// Flags under which the headers and examples of the project give no warning.
pub const STRICT: [&str; 6] = ["-O2", "-g", "-Wall", "-Wextra", "-Werror", "-pedantic"];

/// A check of a source by `compiler`, with the headers in `include` and without a warning; the source is the next argument.
pub fn syntax_check(compiler: &str, standard: &str, include: &Path) -> Command {
    let mut command = Command::new(compiler);
    command
        .args([
            standard,
            "-Wall",
            "-Wextra",
            "-Werror",
            "-pedantic",
            "-fsyntax-only",
            "-I",
        ])
        .arg(include);
    command
}

/// A folder with everything installed below `prefix`, and with the built files.
pub struct NativeBuild {
    folder: PathBuf,
}

/// Runs `command` to its end.
///
/// # Panics
/// When it fails, with its output.
pub fn run_checked(command: &mut Command) -> String {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let words = [output.stdout, output.stderr].concat();
    let words = String::from_utf8_lossy(&words).into_owned();
    assert!(output.status.success(), "{command:?}: {words}");
    words
}

impl NativeBuild {
    /// The folder of this test, called `name`: a new one in each process.
    pub fn new(name: &str) -> NativeBuild {
        let folder = built().join("tmp").join(format!("workshop-{name}"));
        let _ = std::fs::remove_dir_all(&folder);
        std::fs::create_dir_all(&folder).expect("the build's folder can be written");
        let native_build = NativeBuild { folder };
        run_checked(
            Command::new(root().join("crates/escapement-c/install.sh"))
                .current_dir(&native_build.folder)
                .arg("prefix")
                .arg(built()),
        );
        native_build
    }

    /// A file in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.join(name)
    }

    /// The output of pkg-config for the installed package `package`.
    fn flags(&self, package: &str) -> Vec<String> {
        let mut command = Command::new("pkg-config");
        command.env("PKG_CONFIG_PATH", self.path("prefix/lib/pkgconfig"));
        let output = run_checked(command.args(["--cflags", "--libs", package]));
        output.split_whitespace().map(str::to_owned).collect()
    }

    /// Compiles `source`, relative to the project, into `name`, a plug-in or a program.
    fn compile(&self, package: &str, source: &str, name: &str, more: &[&str]) -> PathBuf {
        let out = self.path(name);
        std::fs::create_dir_all(out.parent().expect("a name has a folder")).expect("the folder can be written");
        let mut compiler = if source.ends_with(".cpp") {
            let mut compiler = Command::new("c++");
            compiler.arg("-std=c++17");
            compiler
        } else {
            let mut compiler = Command::new("cc");
            compiler.args(["-std=c11", "-D_GNU_SOURCE"]);
            compiler
        };
        compiler.args(STRICT).args(more);
        run_checked(
            compiler
                .arg(root().join(source))
                .arg("-o")
                .arg(&out)
                .args(self.flags(package)),
        );
        out
    }

    /// A plug-in from `source`.
    pub fn plugin(&self, source: &str, name: &str, more: &[&str]) -> PathBuf {
        self.compile("escapement-plugin", source, name, more)
    }

    /// A program from `source` that drives runs.
    pub fn caller(&self, source: &str, name: &str) -> PathBuf {
        self.compile("escapement-run", source, name, &[])
    }

    /// A program from `source`.
    pub fn program(&self, source: &str, name: &str, more: &[&str]) -> PathBuf {
        self.compile("escapement", source, name, more)
    }
}

/// The examples in C and C++ as programs (`c/spring`) and plug-ins (`c/libspring.so`).
pub fn examples() -> &'static NativeBuild {
    static EXAMPLES: OnceLock<NativeBuild> = OnceLock::new();
    EXAMPLES.get_or_init(|| {
        let native_build = NativeBuild::new("examples");
        for name in ["spring", "plant", "pid", "reference"] {
            let source = format!("examples/c/{name}.c");
            native_build.program(&source, &format!("c/{name}"), &[]);
            native_build.plugin(&source, &format!("c/lib{name}.so"), &[]);
        }
        native_build.program(
            "examples/cpp/spring.cpp",
            "cpp/spring",
            &["-fno-exceptions", "-fno-rtti"],
        );
        native_build.plugin("examples/cpp/spring.cpp", "cpp/libspring.so", &[]);
        native_build.plugin("examples/cpp/loop.cpp", "cpp/libloop.so", &[]);
        native_build.plugin("examples/cpp/operator.cpp", "cpp/liboperator.so", &[]);
        for name in ["crossing", "beacon"] {
            native_build.plugin(&format!("examples/c/{name}.c"), &format!("c/lib{name}.so"), &[]);
        }
        native_build
    })
}

/// `participants.NAME.run` for a plug-in.
pub fn library_override(participant: &str, file: &Path, which: Option<&str>) -> String {
    let which = which
        .map(|which| format!(", participant = {which:?}"))
        .unwrap_or_default();
    format!("participants.{participant}.run={{ library = {:?}{which} }}", text(file))
}

/// `participants.NAME.run` for a program.
pub fn exe_override(participant: &str, file: &Path) -> String {
    format!("participants.{participant}.run={{ exe = {:?} }}", text(file))
}
