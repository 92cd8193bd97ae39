//! Texts and bytes of FMUs as signals.

use escapement_tests::program::{Folder, root, run_orchestrator, text};
use tape::{Reader, Source};

/// Texts between FMUs of both versions, with bytes between those of FMI 3.0; a text that exceeds its capacity ends the run.
#[test]
fn texts_and_bytes_pass_through_two_fmus() {
    let folder = Folder::new("texts");
    let [two, three] =
        ["2", "3"].map(|version| root().join(format!("tests/fmus/reference/fmi{version}/Feedthrough.fmu")));
    let scenario = |size: u32| {
        format!(
            "duration = \"1 s\"\n[participants.first]\nperiod = \"0.1 s\"\nparameters = {{ String_input = \"größer\" }}\n\
             run = {{ fmu = {two:?}, ports = {{ inputs = [], out = [{{ name = \"s\", variable = \"String_output\", size = 40 }}] }} }}\n\
             [participants.second]\nperiod = \"0.2 s\"\nparameters = {{ Binary_input = \"00ff0a\" }}\n\
             [participants.second.run]\nfmu = {three:?}\nfeedthrough = true\n\
             ports = {{ in = [{{ name = \"s\", variable = \"String_input\", size = 40 }}], \
             out = [{{ name = \"s\", variable = \"String_output\", size = {size} }}, \"Binary_output\"] }}\n\
             [connections.link]\nfrom = \"first.out\"\nto = \"second.in\"\n",
        )
    };
    let (file, run) = (folder.write("texts.toml", &scenario(9)), folder.path().join("apart"));
    let other = folder.path().join("together");
    for (out, how) in [(&run, &[][..]), (&other, &["--in-process"])] {
        let output = run_orchestrator(&[&["run", text(&file), "--quiet", "--out", text(out)], how].concat());
        assert_eq!(output.code, Some(0), "{output:?}");
    }
    let output = run_orchestrator(&["compare", text(&run), text(&other)]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let tape = Reader::open(&run.join("tape")).expect("the run has a tape");
    let number = tape.stream("second.out").expect("the stream is there");
    let (fields, mut record) = (
        &tape.streams()[number].descriptor.fields,
        vec![0; tape.streams()[number].stride()],
    );
    for index in 0..tape.count(number) {
        tape.read(number, index, &mut record).expect("the record is there");
        let shown = [0, 1].map(|field| fields[field].shown(&record[8..], 0));
        assert_eq!(shown, ["\"größer\"", "3 bytes 00ff0a"]);
    }
    let short = folder.write("short.toml", &scenario(7));
    let output = run_orchestrator(&[
        "run",
        text(&short),
        "--quiet",
        "--out",
        text(&folder.path().join("short")),
    ]);
    let words = "its output `String_output` has 8 bytes, and its field room for 7: give it more";
    assert!(
        output.code == Some(1) && output.err.contains("`second`") && output.err.contains(words),
        "{output:?}"
    );
}
