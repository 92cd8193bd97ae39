//! Invalid system structures, and structures that a scenario cannot express, are rejected with file and line.

use std::path::Path;

use escapement_tests::fmus::zip_archive;
use escapement_tests::packages::{description, import, package, pair, read};
use escapement_tests::program::{Folder, root, run_orchestrator, text};

#[test]
fn invalid_package_is_refused() {
    let folder = Folder::new("no-package");
    let assert_refused = |file: &Path, words: &[&str]| {
        let output = import(&folder, file, &[]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(
            words.iter().all(|word| output.err.contains(word)),
            "{words:?}: {output:?}"
        );
        assert!(!folder.path().join("imported").exists(), "a refusal leaves nothing");
    };
    assert_refused(
        &folder.write("text.ssp", "this is text and no archive"),
        &["text.ssp", "not a ZIP archive"],
    );
    assert_refused(&folder.path().join("missing.ssp"), &["missing.ssp"]);
    assert_refused(folder.path(), &["no SystemStructure.ssd"]);
    let path = folder.path().join("empty.ssp");
    std::fs::write(&path, zip_archive(&[("readme.txt", b"hello".to_vec())])).expect("written");
    assert_refused(&path, &["empty.ssp", "no SystemStructure.ssd"]);
    std::fs::write(&path, zip_archive(&[("../SystemStructure.ssd", Vec::new())])).expect("written");
    assert_refused(&path, &["leads out of the archive"]);
    assert_refused(
        &package(&folder, "<ssd>", &[]),
        &["system.ssp: SystemStructure.ssd:1", "not XML"],
    );
    assert_refused(&package(&folder, "<ssd/>", &[]), &["the root is `ssd`"]);
    let later = description("", "").replace("version=\"1.0\"", "version=\"3.0\"");
    assert_refused(
        &package(&folder, &later, &[]),
        &["SystemStructure.ssd:2", "SSP version `3.0`"],
    );
    assert_refused(
        &package(&folder, &description("", ""), &[]),
        &["SystemStructure.ssd:3", "0 components"],
    );
    // An existing file is not overwritten.
    std::fs::create_dir(folder.path().join("full")).expect("made");
    folder.write("full/x", "x");
    let full = folder.path().join("full");
    let output = run_orchestrator(&["import", text(&path), "--out", text(&full)]);
    assert!(output.code == Some(2) && output.err.contains("not empty"), "{output:?}");
}

/// Checks that a package with a mass on a spring (`a.fmu`) and a damper (`b.fmu`) is rejected with these words.
fn assert_package_refused(folder: &Folder, name: &str, system: &str, rest: &str, words: &[&str]) {
    let (spring, damper) = pair(folder);
    let files = [("a.fmu", spring), ("b.fmu", damper)];
    let package = package(folder, &description(system, rest), &files);
    let output = import(folder, &package, &[]);
    assert_eq!(output.code, Some(2), "{name}: {output:?}");
    let missing: Vec<_> = words.iter().filter(|word| !output.err.contains(**word)).collect();
    assert!(missing.is_empty(), "{name}: {missing:?} in {}", output.err);
}

/// All mistakes are reported at once, each with its line.
#[test]
fn elements_that_are_no_fmus_are_refused_all_at_once() {
    let folder = Folder::new("elements");
    assert_package_refused(
        &folder,
        "elements",
        "<ssd:Elements>\n<ssd:Component name=\"model\" type=\"text/x-modelica\" source=\"a.fmu\"/>\n<ssd:Component name=\"none\"/>\n\
         <ssd:SignalDictionaryReference name=\"bus\" dictionary=\"d\"/>\n<ssd:Component name=\"out\" source=\"../a.fmu\"/>\n\
         <ssd:Component name=\"gone\" source=\"c.fmu\"/>\n<ssd:Component name=\"me\" source=\"a.fmu\" implementation=\"ModelExchange\"/>\n\
         <ssd:Component name=\"me\" source=\"http://host/a.fmu\"/>\n</ssd:Elements>",
        "",
        &[
            ":5: the component `model` is a `text/x-modelica`",
            ":6: the component `none` has no `source`",
            ":7: there is no signal dictionary `d` in this system or in one around it",
            ":8: the source `../a.fmu`",
            ":9: the source `c.fmu` is not in the package",
            ":10: the component `me` is wanted as ModelExchange",
            ":11: the source `http://host/a.fmu`",
            ":11: two elements of a system are called `me`",
        ],
    );
}

/// The two of [`assert_package_refused`] as components `a` and `b`, which end on line 5.
const PARTS: &str = "<ssd:Connectors><ssd:Connector name=\"in\" kind=\"input\"/></ssd:Connectors>\n<ssd:Elements>\
     <ssd:Component name=\"a\" source=\"a.fmu\"><ssd:Connectors><ssd:Connector name=\"f\" kind=\"input\"/>\
     <ssd:Connector name=\"x\" kind=\"output\"/><ssd:Connector name=\"v\" kind=\"output\"/><ssd:Connector name=\"marker\" kind=\"parameter\"/>\
     </ssd:Connectors></ssd:Component>\
     <ssd:Component name=\"b\" source=\"b.fmu\"><ssd:Connectors><ssd:Connector name=\"v\" kind=\"input\"/>\
     <ssd:Connector name=\"f\" kind=\"output\"/><ssd:Connector name=\"damping\" kind=\"parameter\"/></ssd:Connectors></ssd:Component></ssd:Elements>\n";

#[test]
fn unsupported_feature_is_refused_with_its_line() {
    let folder = Folder::new("refusals");
    let assert_refused =
        |name: &str, system: &str, words: &[&str]| assert_package_refused(&folder, name, system, "", words);
    let with = |connections: &str| format!("{PARTS}<ssd:Connections>\n{connections}\n</ssd:Connections>");
    let link = |from: &str, to: &str, rest: &str| {
        let end = |side: &str, text: &str| match text.split_once('.') {
            Some((element, connector)) => format!("{side}Element=\"{element}\" {side}Connector=\"{connector}\""),
            None => format!("{side}Connector=\"{text}\""),
        };
        format!(
            "<ssd:Connection {} {}>{rest}</ssd:Connection>\n",
            end("start", from),
            end("end", to)
        )
    };
    assert_refused(
        "ends",
        &with(&[link("a.y", "b.v", ""), link("c.x", "b.v", ""), link("a.f", "b.v", "")].concat()),
        &[
            ":7: `a` has no connector `y`",
            ":8: `startElement`: there is no element `c`; there is `a`, `b`",
        ],
    );
    assert_refused(
        "direction",
        &with(&link("a.f", "b.v", "")),
        &[":7: the kinds of `a.f` and `b.v` do not say"],
    );
    assert_refused(
        "twice",
        &with(&[link("a.v", "b.v", ""), link("b.v", "in", "")].concat()),
        &[":8: `b.v` is fed by two connections"],
    );
    assert_refused(
        "dimension",
        &with(&link("a.x", "b.v", "")),
        &[
            ":7: `a.x` does not become `b.v`",
            "`m` is no `m/s`",
            "suppressUnitConversion",
        ],
    );
    let table = "<ssc:BooleanMappingTransformation><ssc:MapEntry source=\"true\" target=\"false\"/></ssc:BooleanMappingTransformation>";
    assert_refused(
        "table",
        &with(&link("a.v", "b.v", table)),
        &[":7: ", "BooleanMappingTransformation cannot be done"],
    );
    assert_refused(
        "parameter",
        &with(&link("a.v", "b.damping", "")),
        &[":7: `b.damping` is a parameter"],
    );
    let indices = link("a.v", "b.v", "").replace("<ssd:Connection ", "<ssd:Connection startIndices=\"1\" ");
    assert_refused("indices", &with(&indices), &[":7: `startIndices`"]);
}

#[test]
fn system_that_contradicts_its_fmus_is_refused_with_its_line() {
    let folder = Folder::new("unfit");
    let assert_refused = |name: &str, system: &str, rest: &str, words: &[&str]| {
        assert_package_refused(&folder, name, system, rest, words)
    };
    let connectors = PARTS.replace(
        "name=\"damping\" kind=\"parameter\"",
        "name=\"dumping\" kind=\"parameter\"",
    );
    assert_refused(
        "connector",
        &connectors,
        "",
        &["no variable for the connector `b.dumping`; did you mean `damping`?"],
    );
    let kinds = PARTS.replace("name=\"damping\" kind=\"parameter\"", "name=\"damping\" kind=\"input\"");
    assert_refused("kind", &kinds, "", &["the connector `b.damping` has another kind"]);
    let bound = |value: &str| {
        format!(
            "<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version=\"1.0\" name=\"p\"><ssv:Parameters>\n\
             {value}</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>{PARTS}"
        )
    };
    let values = "<ssv:Parameter name=\"a.mass\"><ssv:String value=\"heavy\"/></ssv:Parameter>\n\
         <ssv:Parameter name=\"b.f\"><ssv:Real value=\"1\"/></ssv:Parameter>\n<ssv:Parameter name=\"a.marker\"><ssv:Real value=\"1\"/></ssv:Parameter>\n";
    assert_refused(
        "values",
        &bound(values),
        "",
        &[
            ":5: the parameter `a.mass`: it is a String, and `mass` of the FMU is a Float64",
            ":6: the parameter `b.f`: `f` of the FMU cannot be set",
            ":7: the parameter `a.marker`: it is a Real",
        ],
    );
    assert_refused(
        "number",
        &bound("<ssv:Parameter name=\"a.mass\"><ssv:Real value=\"nan\"/></ssv:Parameter>"),
        "",
        &[":5: `nan` is no Real"],
    );
    assert_refused(
        "experiment",
        PARTS,
        "<ssd:DefaultExperiment startTime=\"-1\" stopTime=\"2\"/>",
        &["starts at -1 s"],
    );
}

/// What FMUs declare about their outputs: values would have to pass through all of them at the same instant.
#[test]
fn algebraic_loop_is_refused_unless_it_is_opened() {
    let folder = Folder::new("loop");
    let file = read(&root().join("tests/fmus/reference/fmi2/Feedthrough.fmu"));
    let component = |name: &str| {
        format!(
            "<ssd:Component name=\"{name}\" source=\"f.fmu\"><ssd:Connectors><ssd:Connector name=\"Float64_continuous_input\" kind=\"input\"/>\
             <ssd:Connector name=\"Float64_continuous_output\" kind=\"output\"/></ssd:Connectors></ssd:Component>\n"
        )
    };
    let link = |from: &str, to: &str| {
        format!(
            "<ssd:Connection startElement=\"{from}\" startConnector=\"Float64_continuous_output\" endElement=\"{to}\" \
             endConnector=\"Float64_continuous_input\"/>"
        )
    };
    let system = format!(
        "<ssd:Elements>\n{}{}{}</ssd:Elements><ssd:Connections>{}{}</ssd:Connections>",
        component("first"),
        component("second"),
        component("third"),
        link("second", "third"),
        link("third", "second")
    );
    let package = package(&folder, &description(&system, ""), &[("f.fmu", file)]);
    let output = import(&folder, &package, &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output
            .err
            .contains("SystemStructure.ssd:6: `second` -> `third` -> `second` is an algebraic loop"),
        "{output:?}"
    );
    assert!(output.err.contains("--open-loops"), "{output:?}");
    let output = import(&folder, &package, &["--open-loops"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.err.contains("the default experiment has no stop time"),
        "{output:?}"
    );
    let scenario = folder.path().join("imported/scenario.toml");
    let output = run_orchestrator(&[
        "run",
        text(&scenario),
        "--in-process",
        "--quiet",
        "--out",
        text(&folder.path().join("run")),
    ]);
    assert_eq!(output.code, Some(0), "{output:?}");
}
