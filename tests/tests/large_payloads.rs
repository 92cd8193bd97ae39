//! Images of megabytes as samples: in processes and in one, on the tape, in exports and on the page.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use escapement_tests::compiler::NativeBuild;
use escapement_tests::program::{Folder, ProgramOutput, run_orchestrator, text};

/// The cameras' plug-ins: a picture of 2048 by 2048 pixels, and one of 64 MiB less 8192 bytes.
fn plugins() -> &'static NativeBuild {
    static PLUGINS: OnceLock<NativeBuild> = OnceLock::new();
    PLUGINS.get_or_init(|| {
        let native_build = NativeBuild::new("cameras");
        for (name, rows, columns) in [
            ("libcamera.so", 2048, 2048),
            ("liblarge.so", 8191, 8192),
            ("libbeyond.so", 8192, 8192),
        ] {
            let size = [format!("-DROWS={rows}"), format!("-DCOLUMNS={columns}")];
            native_build.plugin("tests/plugins/camera.c", name, &[&size[0], &size[1]]);
        }
        native_build
    })
}

/// A camera at `period` and a viewer that sees its pictures 20 ms late; `more` stands at the end.
fn scenario(folder: &Folder, plugin: &str, period: &str, duration: &str, more: &str) -> PathBuf {
    let library = plugins().path(plugin);
    let file = folder.path().join("pictures.toml");
    let written = fs::write(
        &file,
        format!(
            "title = \"Pictures\"\nduration = \"{duration}\"\n\
             [participants.camera]\nrun = {{ library = {library:?}, participant = \"camera\" }}\nperiod = \"{period}\"\n\
             [participants.viewer]\nrun = {{ library = {library:?}, participant = \"viewer\" }}\nperiod = \"{period}\"\noffset = \"20 ms\"\n\
             [connections.pictures]\nfrom = \"camera.picture\"\nto = \"viewer.picture\"\ndelay = \"20 ms\"\n{more}",
            library = text(&library)
        ),
    );
    written.expect("the folder can be written");
    file
}

fn assert_success(output: ProgramOutput) {
    assert_eq!(output.code, Some(0), "{output:?}");
}

/// The viewer's results: exposure, sum and last pixel of each image.
fn viewer_results(run: &Path) -> Vec<(f64, u64, u64)> {
    let bytes = fs::read(run.join("tape/viewer.seen.bin")).expect("the tape has the stream");
    let records = bytes.as_chunks::<32>().0.iter();
    let word = |record: &[u8; 32], at: usize| u64::from_le_bytes(*record[at..].first_chunk().expect("a word"));
    records
        .map(|record| (f64::from_bits(word(record, 8)), word(record, 16), word(record, 24)))
        .collect()
}

/// The same, computed from the camera's law.
fn expected(rows: u64, columns: u64, pictures: u64) -> Vec<(f64, u64, u64)> {
    let picture = |index: u64| {
        let last = (index + 1) % 256;
        let all: u64 = (0..rows).map(|row| (index + row) % 251 * columns).sum();
        (0.001 * (index + 1) as f64, all - (index + rows - 1) % 251 + last, last)
    };
    (0..pictures).map(picture).collect()
}

#[test]
fn pictures_give_one_tape_and_are_exported_as_they_are() {
    let folder = Folder::new("pictures");
    let file = scenario(&folder, "libcamera.so", "100 ms", "1 s", "");
    let path = |name: &str| folder.path().join(name);
    let (processes, within) = (path("processes"), path("within"));
    assert_success(run_orchestrator(&[
        "run",
        text(&file),
        "--quiet",
        "--out",
        text(&processes),
    ]));
    let arguments = ["run", text(&file), "--quiet", "--out", text(&within)];
    assert_success(run_orchestrator(&[&arguments[..], &["--in-process"]].concat()));
    assert_success(run_orchestrator(&[
        "replay",
        text(&processes),
        "--participant",
        "viewer",
        "--quiet",
    ]));
    assert_success(run_orchestrator(&["compare", text(&processes), text(&within)]));
    assert_eq!(viewer_results(&processes), expected(2048, 2048, 10));

    let size = 8 + 2048 * 2048;
    assert_eq!(
        fs::metadata(within.join("tape/camera.picture.bin")).unwrap().len(),
        10 * (8 + size)
    );
    // One column or array for all pixels of a picture, each byte once.
    let exported = path("exported");
    for format in ["csv", "parquet", "mcap", "mat"] {
        assert_success(run_orchestrator(&[
            "export",
            text(&within),
            "--to",
            format,
            "--out",
            text(&exported.join(format)),
        ]));
    }
    let table = fs::read_to_string(exported.join("csv/camera.picture.csv")).unwrap();
    assert_eq!(table.lines().next(), Some("t [s],exposure [s]"));
    let length = |name: &str| fs::metadata(exported.join(name)).unwrap().len();
    for name in ["csv/camera.picture.pixels.npy", "parquet/camera.picture.parquet"] {
        let more = length(name)
            .checked_sub(10 * 2048 * 2048)
            .unwrap_or_else(|| panic!("{name} is too short"));
        assert!(more < 64 << 10, "{name} has {more} bytes besides the pixels");
    }
    // Neither the page nor `check` iterates over the pixels.
    let page = path("page.html");
    assert_success(run_orchestrator(&["report", text(&within), "--out", text(&page)]));
    let page = fs::read_to_string(page).unwrap();
    assert!(
        page.contains("4194304 elements"),
        "the page does not say that it does not draw the picture"
    );
    assert!(page.len() < 4 << 20, "the page has {} bytes", page.len());
    let plan = run_orchestrator(&["check", text(&file), "--json"]);
    assert!(
        plan.out.len() < 64 << 10,
        "check --json prints {} bytes",
        plan.out.len()
    );
}

#[test]
fn largest_picture_goes_through_a_process_and_one_loop() {
    let folder = Folder::new("largest");
    let file = scenario(&folder, "liblarge.so", "1 s", "2 s", "");
    let path = |name: &str| folder.path().join(name);
    assert_success(run_orchestrator(&[
        "run",
        text(&file),
        "--quiet",
        "--out",
        text(&path("processes")),
    ]));
    assert_success(run_orchestrator(&[
        "run",
        text(&file),
        "--quiet",
        "--in-process",
        "--out",
        text(&path("within")),
    ]));
    assert_success(run_orchestrator(&[
        "compare",
        text(&path("processes")),
        text(&path("within")),
    ]));
    assert_eq!(viewer_results(&path("processes")), expected(8191, 8192, 2));
}

#[test]
fn element_wise_use_of_pictures_is_refused_with_the_remedy() {
    let folder = Folder::new("elements");
    let refusals = [
        (
            "[guards.alive]\noutput = \"camera.picture\"\nfrozen-for = \"1 s\"\n",
            "guards.alive.output: `Picture` has 4194305 elements, and at most 1048576 are looked at one by one: name a field or an element \
             of it, such as `exposure`",
        ),
        (
            "[[faults]]\nat = \"0.1 s\"\noutput = \"camera.picture\"\nfield = \"pixels\"\nkind = \"dropout\"\n",
            "`pixels` has 4194304 elements, and at most 1048576 are looked at one by one",
        ),
        (
            "[measures.bright]\nof = \"camera.picture.pixels\"\ncompute = \"max\"\n",
            "`pixels` has 4194304 elements, and at most 1048576 are looked at one by one",
        ),
    ];
    for (more, reason) in refusals {
        let file = scenario(&folder, "libcamera.so", "100 ms", "1 s", more);
        let output = run_orchestrator(&["check", text(&file)]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(output.err.contains(reason), "{more}: {}", output.err);
    }
    let file = scenario(&folder, "libcamera.so", "100 ms", "1 s", "map = \"by-name\"\n");
    let output = run_orchestrator(&["check", text(&file)]);
    assert_eq!(output.code, Some(2), "{output:?}");
    let reason = "connections.pictures.map: an input of 4194312 bytes (`Picture`) is not put together from fields, only one of at most \
                  1048576: connect it with an output of the same description";
    assert!(output.err.contains(reason), "{}", output.err);
    // Single elements are checked, without iterating over the others.
    let more = "[guards.last]\noutput = \"camera.picture\"\nfield = \"pixels[2047][2047]\"\nrange = [0, 200]\n\
                [measures.last]\nof = \"camera.picture.pixels[2047][2047]\"\ncompute = \"max\"\n";
    let file = scenario(&folder, "libcamera.so", "100 ms", "1 s", more);
    let out = folder.path().join("run");
    let output = run_orchestrator(&["run", text(&file), "--json", "--in-process", "--out", text(&out)]);
    assert_eq!(output.json()["measures"]["last"]["value"], 10.0, "{output:?}");

    let file = scenario(&folder, "libbeyond.so", "1 s", "1 s", "");
    let output = run_orchestrator(&["check", text(&file)]);
    assert!(
        output
            .err
            .contains("a payload of 67108872 bytes; between 1 and 67108864 are allowed"),
        "{output:?}"
    );
}
