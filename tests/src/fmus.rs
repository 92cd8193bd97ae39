//! FMUs that tests build from the C sources in `tests/fmus`, and invalid archives.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::compiler::run_checked;
use crate::program::{Folder, root, text};

/// The description of a test FMU.
#[derive(Debug, Clone, Copy)]
pub struct TestFmu {
    /// 2 or 3.
    pub version: u8,
    /// A damper instead of a mass on a spring.
    pub damper: bool,
    /// Whether the FMU can save its state.
    pub state: bool,
    /// The constant of `model.h` that selects the fault.
    pub fault: &'static str,
    /// Attributes of `CoSimulation`.
    pub attributes: &'static str,
    /// The sizes of the array in the description and in the library; nothing else is in the FMU then.
    pub sizes: Option<(u32, u32)>,
    /// The number that its own helper library gives, where it needs one.
    pub helper: Option<u32>,
    /// The folder of its library.
    pub platform: Option<&'static str>,
}

impl TestFmu {
    /// A healthy spring that can save its state.
    pub const fn new(version: u8) -> TestFmu {
        TestFmu {
            version,
            damper: false,
            state: true,
            fault: "NO_FAULT",
            attributes: "",
            sizes: None,
            helper: None,
            platform: None,
        }
    }

    /// Builds the FMU as `name` in `folder`.
    ///
    /// # Panics
    /// When there is no C compiler.
    pub fn build(self, folder: &Folder, name: &str) -> PathBuf {
        let library = folder.path().join(format!("{name}.so"));
        let source = if self.version == 2 { "two.c" } else { "three.c" };
        let mut compiler = Command::new("cc");
        compiler.args(["-shared", "-fPIC", "-O1", "-Wall", "-o", text(&library)]);
        compiler.arg(format!("-DFAULT={}", self.fault));
        compiler.args(self.damper.then_some("-DDAMPER"));
        compiler.args(self.state.then_some("-DSTATE"));
        compiler.args(self.sizes.map(|(_, size)| format!("-DSIZE={size}")));
        compiler
            .arg(root().join("tests/fmus").join(source))
            .args(["-lm", "-pthread"]);
        let helper = self
            .helper
            .map(|number| helper_library(&folder.path().join(name), number));
        compiler.args(helper.iter().flat_map(|helper| link_arguments(helper)));
        let output = compiler.output().expect("a C compiler can be started");
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let code = std::fs::read(&library).expect("the compiler has written it");
        let native = if self.version == 2 { "linux64" } else { "x86_64-linux" };
        let place = format!("binaries/{}/model.so", self.platform.unwrap_or(native));
        let path = folder.path().join(format!("{name}.fmu"));
        let mut entries = vec![
            ("modelDescription.xml", self.description().into_bytes()),
            (place.as_str(), code),
        ];
        let beside = Path::new(&place).with_file_name(HELPER);
        let helper = helper.map(|helper| std::fs::read(helper).expect("the compiler has written it"));
        entries.extend(helper.map(|code| (text(&beside), code)));
        std::fs::write(&path, zip_archive(&entries)).expect("the folder can be written");
        path
    }

    fn description(self) -> String {
        let (token, state) = match self.version {
            2 => ("guid", "canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\""),
            _ => (
                "instantiationToken",
                "canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\"",
            ),
        };
        let state = if self.state { state } else { "" };
        let mut variables = String::new();
        for (number, (name, unit, about)) in self.variables().iter().enumerate() {
            variables += &match self.version {
                2 => format!(
                    "<ScalarVariable name=\"{name}\" valueReference=\"{number}\" {}><Real unit=\"{unit}\" {}/></ScalarVariable>\n",
                    about.0, about.1
                ),
                _ => format!(
                    "<Float64 name=\"{name}\" valueReference=\"{number}\" unit=\"{unit}\" {} {}/>\n",
                    about.0, about.1
                ),
            };
        }
        variables += match self.version {
            2 => {
                "<ScalarVariable name=\"marker\" valueReference=\"9\" causality=\"parameter\" variability=\"fixed\"><String start=\"none\"/></ScalarVariable>"
            }
            _ => {
                "<String name=\"marker\" valueReference=\"9\" causality=\"parameter\" variability=\"fixed\"><Start value=\"none\"/></String>"
            }
        };
        if let Some((size, _)) = self.sizes {
            variables = format!(
                "<Float64 name=\"all\" valueReference=\"1\" causality=\"output\"><Dimension start=\"{size}\"/></Float64>"
            );
        }
        format!(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"{}.0\" modelName=\"Spring\" {token}=\"{{spring}}\">\n\
             <CoSimulation modelIdentifier=\"model\" canHandleVariableCommunicationStepSize=\"true\" {state} {}/>\n<UnitDefinitions>\
             <Unit name=\"m\"><BaseUnit m=\"1\"/></Unit><Unit name=\"m/s\"><BaseUnit m=\"1\" s=\"-1\"/></Unit>\
             <Unit name=\"N\"><BaseUnit kg=\"1\" m=\"1\" s=\"-2\"/></Unit><Unit name=\"kg\"><BaseUnit kg=\"1\"/></Unit>\
             <Unit name=\"N/m\"><BaseUnit kg=\"1\" s=\"-2\"/></Unit><Unit name=\"N.s/m\"><BaseUnit kg=\"1\" s=\"-1\"/></Unit>\
             <Unit name=\"m/s2\"><BaseUnit m=\"1\" s=\"-2\"/></Unit></UnitDefinitions>\n<ModelVariables>\n{variables}\n</ModelVariables>\n\
             <ModelStructure/>\n</fmiModelDescription>\n",
            self.version, self.attributes
        )
    }

    #[allow(clippy::type_complexity, reason = "a table")]
    fn variables(self) -> &'static [(&'static str, &'static str, (&'static str, &'static str))] {
        const INPUT: &str = "causality=\"input\"";
        const OUTPUT: &str = "causality=\"output\"";
        const PARAMETER: &str = "causality=\"parameter\" variability=\"fixed\"";
        if self.damper {
            &[
                ("v", "m/s", (INPUT, "start=\"0\"")),
                ("f", "N", (OUTPUT, "")),
                ("unused", "N", ("causality=\"local\"", "")),
                ("damping", "N.s/m", (PARAMETER, "start=\"0.5\" min=\"0\" max=\"10\"")),
            ]
        } else {
            &[
                ("f", "N", (INPUT, "start=\"0\"")),
                ("x", "m", ("causality=\"output\" initial=\"exact\"", "start=\"0.1\"")),
                ("v", "m/s", (OUTPUT, "")),
                ("stiffness", "N/m", (PARAMETER, "start=\"40\" min=\"0\"")),
                ("mass", "kg", (PARAMETER, "start=\"1\" min=\"0.1\" max=\"100\"")),
                ("inner.a", "m/s2", ("causality=\"local\"", "")),
            ]
        }
    }
}

/// The file name of a helper library.
const HELPER: &str = "libescapementhelper.so";

/// Compiles a helper library into `folder`, which gives `number`.
///
/// # Panics
/// When there is no C compiler.
pub fn helper_library(folder: &Path, number: u32) -> PathBuf {
    std::fs::create_dir_all(folder).expect("the folder can be written");
    let library = folder.join(HELPER);
    let mut compiler = Command::new("cc");
    let soname = format!("-Wl,-soname,{HELPER}");
    compiler.args([
        "-shared",
        "-fPIC",
        &soname,
        &format!("-DNUMBER={number}"),
        "-o",
        text(&library),
    ]);
    run_checked(compiler.arg(root().join("tests/fmus/helper.c")));
    library
}

/// The arguments that link a library with `helper`, which is beside it.
pub fn link_arguments(helper: &Path) -> [String; 3] {
    let (none, path) = ("-Wl,--no-as-needed", "-Wl,-rpath,$ORIGIN");
    [none.to_owned(), text(helper).to_owned(), path.to_owned()]
}

/// A ZIP archive of these files, uncompressed.
pub fn zip_archive(entries: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, contents) in entries {
        let (size, crc) = (contents.len() as u32, checksum(contents));
        let at = bytes.len() as u32;
        let mut common = vec![20, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        common.extend(crc.to_le_bytes());
        common.extend(size.to_le_bytes());
        common.extend(size.to_le_bytes());
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0, 0]);
        bytes.extend(b"PK\x03\x04");
        bytes.extend(&common);
        bytes.extend(name.as_bytes());
        bytes.extend(contents);
        directory.extend(b"PK\x01\x02\x14\x00");
        directory.extend(&common);
        directory.extend([0; 10]);
        directory.extend(at.to_le_bytes());
        directory.extend(name.as_bytes());
    }
    let (start, count) = (bytes.len() as u32, entries.len() as u16);
    bytes.extend(&directory);
    bytes.extend(b"PK\x05\x06\x00\x00\x00\x00");
    bytes.extend(count.to_le_bytes());
    bytes.extend(count.to_le_bytes());
    bytes.extend((directory.len() as u32).to_le_bytes());
    bytes.extend(start.to_le_bytes());
    bytes.extend([0, 0]);
    bytes
}

/// CRC-32.
fn checksum(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xedb8_8320 & 0_u32.wrapping_sub(crc & 1))
        })
    })
}

/// The folders with unpacked FMUs below `temporary`.
pub fn unpacked_folders(temporary: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(temporary).into_iter().flatten().flatten();
    let named = entries.filter(|entry| entry.file_name().to_string_lossy().starts_with("escapement-fmu-"));
    named.map(|entry| entry.path()).collect()
}
