//! Systems of several files, signal dictionaries and texts in system structures: their tapes equal those of handwritten scenarios.

use escapement_tests::fmus::zip_archive;
use escapement_tests::packages::{
    NESTED_REST, SPACES, description, import, is_what_is_written_by_hand, package, pair, read,
};
use escapement_tests::program::{Folder, root};

/// A mass in a nested package and a brake in a separate description, which refers to its FMU relative to its own folder.
const PARTS: &str = r#"
<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
  <ssv:ParameterSet version="1.0" name="from outside"><ssv:Parameters>
    <ssv:Parameter name="mass.spring.x"><ssv:Real value="0.2"/></ssv:Parameter>
    <ssv:Parameter name="brake.c"><ssv:Real value="0.5"/></ssv:Parameter>
  </ssv:Parameters></ssv:ParameterSet>
</ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
<ssd:Elements>
  <ssd:Component name="mass" type="application/x-ssp-package" source="parts/mass.ssp">
    <ssd:Connectors><ssd:Connector name="push" kind="input"/><ssd:Connector name="speed" kind="output"/></ssd:Connectors>
  </ssd:Component>
  <ssd:Component name="brake" type="application/x-ssp-definition" source="parts/the%20brake.ssd">
    <ssd:Connectors>
      <ssd:Connector name="speed" kind="input"><ssc:Real unit="mm/s"/></ssd:Connector>
      <ssd:Connector name="force" kind="output"/><ssd:Connector name="c" kind="parameter"/>
    </ssd:Connectors>
  </ssd:Component>
</ssd:Elements>
<ssd:Connections>
  <ssd:Connection startElement="mass" startConnector="speed" endElement="brake" endConnector="speed"/>
  <ssd:Connection startElement="brake" startConnector="force" endElement="mass" endConnector="push"/>
</ssd:Connections>"#;

const MASS: &str = r#"
<ssd:Connectors><ssd:Connector name="push" kind="input"/><ssd:Connector name="speed" kind="output"/></ssd:Connectors>
<ssd:ParameterBindings><ssd:ParameterBinding source="resources/mass.ssv"/></ssd:ParameterBindings>
<ssd:Elements><ssd:Component name="spring" source="resources/spring.fmu"><ssd:Connectors>
  <ssd:Connector name="f" kind="input"/><ssd:Connector name="v" kind="output"/>
</ssd:Connectors></ssd:Component></ssd:Elements>
<ssd:Connections>
  <ssd:Connection startConnector="push" endElement="spring" endConnector="f"/>
  <ssd:Connection startElement="spring" startConnector="v" endConnector="speed"/>
</ssd:Connections>"#;

const BRAKE: &str = r#"
<ssd:Connectors>
  <ssd:Connector name="speed" kind="input"/><ssd:Connector name="force" kind="output"/><ssd:Connector name="c" kind="parameter"/>
</ssd:Connectors>
<ssd:Elements><ssd:Component name="damper" source="./damper.fmu"><ssd:Connectors>
  <ssd:Connector name="v" kind="input"/><ssd:Connector name="f" kind="output"/><ssd:Connector name="damping" kind="parameter"/>
</ssd:Connectors></ssd:Component></ssd:Elements>
<ssd:Connections>
  <ssd:Connection startConnector="speed" endElement="damper" endConnector="v"/>
  <ssd:Connection startElement="damper" startConnector="f" endConnector="force"/>
  <ssd:Connection startConnector="c" endElement="damper" endConnector="damping"/>
</ssd:Connections>"#;

/// The package of [`PARTS`] with other descriptions in it.
fn parts(folder: &Folder, mass: &str, brake: &str) -> std::path::PathBuf {
    let (spring, damper) = pair(folder);
    let values = format!(
        "<ssv:ParameterSet {SPACES} version=\"1.0\" name=\"p\"><ssv:Parameters><ssv:Parameter name=\"spring.mass\"><ssv:Real value=\"2\"/>\
         </ssv:Parameter><ssv:Parameter name=\"spring.x\"><ssv:Real value=\"7\"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"
    );
    let mass = zip_archive(&[
        ("SystemStructure.ssd", description(mass, "").into_bytes()),
        ("resources/mass.ssv", values.into_bytes()),
        ("resources/spring.fmu", spring),
    ]);
    let files = [
        ("parts/mass.ssp", mass),
        ("parts/the brake.ssd", description(brake, "").into_bytes()),
        ("parts/damper.fmu", damper),
    ];
    package(folder, &description(PARTS, NESTED_REST), &files)
}

#[test]
fn systems_of_other_files_are_the_scenario_written_by_hand() {
    let folder = Folder::new("parts");
    let package = parts(&folder, MASS, BRAKE);
    let output = import(&folder, &package, &["--period", "2 ms"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    is_what_is_written_by_hand(
        &folder,
        r#"
        duration = "2 s"
        [participants.mass-spring]
        period = "2 ms"
        run.fmu = "fmus/spring.fmu"
        parameters = { x = "0.2 m", mass = "2 kg" }
        [participants.brake-damper]
        period = "2 ms"
        run.fmu = "fmus/damper.fmu"
        parameters = { damping = "0.5 N s/m" }
        [connections.speed]
        from = "mass-spring.outputs"
        to = "brake-damper.inputs"
        map = { v = "v" }
        [connections.force]
        from = "brake-damper.outputs"
        to = "mass-spring.inputs"
        map = { f = "f" }
        "#,
    );
}

/// A mistake in a system of another file is reported with that file, and a system that contains itself is rejected.
#[test]
fn error_in_a_referenced_system_names_its_file_and_line() {
    let folder = Folder::new("parts-refused");
    let missing = MASS.replace("resources/spring.fmu", "resources/gone.fmu");
    let within = BRAKE.replace(
        "name=\"damper\" source=\"./damper.fmu\"",
        "name=\"damper\" type=\"application/x-ssp-definition\" source=\"the%20brake.ssd\"",
    );
    for (mass, brake, words) in [
        (
            missing.as_str(),
            BRAKE,
            &["parts/mass.ssp!/SystemStructure.ssd:7: the source `resources/gone.fmu` is not in the package"][..],
        ),
        (
            MASS,
            &BRAKE.replace("endConnector=\"damping\"", "endConnector=\"dampening\""),
            &["parts/the brake.ssd:14: `damper` has no connector `dampening`; did you mean `damping`?"],
        ),
        (
            &MASS.replace("name=\"speed\" kind=\"output\"", "name=\"velocity\" kind=\"output\""),
            BRAKE,
            &["SystemStructure.ssd:13: the connector `speed` of `mass` is none of the system that it names"],
        ),
        (MASS, &within, &["parts/the brake.ssd", "nested more than 64 deep"]),
    ] {
        let output = import(&folder, &parts(&folder, mass, brake), &[]);
        assert_eq!(output.code, Some(2), "{output:?}");
        assert!(
            words.iter().all(|word| output.err.contains(word)),
            "{words:?}: {output:?}"
        );
    }
}

/// A signal dictionary carries the speed into a nested system, in another unit, and the force out of it.
#[test]
fn signal_dictionary_is_the_connections_written_by_hand() {
    let folder = Folder::new("dictionary");
    let (spring, damper) = pair(&folder);
    let bus = |name: &str, unit: &str| {
        format!(
            "<ssd:SignalDictionaryReference name=\"{name}\" dictionary=\"bus\"><ssd:Connectors>\
             <ssd:Connector name=\"speed\" kind=\"inout\">{unit}</ssd:Connector><ssd:Connector name=\"force\" kind=\"inout\"/>\
             </ssd:Connectors></ssd:SignalDictionaryReference>"
        )
    };
    let component = |name: &str, out: &str, into: &str| {
        format!(
            "<ssd:Component name=\"{name}\" source=\"{name}.fmu\"><ssd:Connectors><ssd:Connector name=\"{out}\" kind=\"output\"/>\
             <ssd:Connector name=\"{into}\" kind=\"input\"/></ssd:Connectors></ssd:Component>"
        )
    };
    let wire = |from: &str, output: &str, to: &str, input: &str| {
        format!(
            "<ssd:Connection startElement=\"{from}\" startConnector=\"{output}\" endElement=\"{to}\" endConnector=\"{input}\"/>"
        )
    };
    let system = |extra: &str| {
        format!(
            "<ssd:SignalDictionaries><ssd:SignalDictionary name=\"bus\"/></ssd:SignalDictionaries>\n<ssd:Elements>{}{}\
             <ssd:System name=\"brake\"><ssd:Elements>{}{}</ssd:Elements>\n<ssd:Connections>{}{}{extra}</ssd:Connections></ssd:System>\
             </ssd:Elements>\n<ssd:Connections>{}{}</ssd:Connections>",
            component("spring", "v", "f"),
            bus("outer", "<ssc:Real unit=\"mm/s\"/>"),
            component("damper", "f", "v"),
            bus("inner", ""),
            wire("inner", "speed", "damper", "v"),
            wire("damper", "f", "inner", "force"),
            wire("spring", "v", "outer", "speed"),
            wire("outer", "force", "spring", "f")
        )
    };
    let files = [("spring.fmu", spring), ("damper.fmu", damper)];
    let twice = package(
        &folder,
        &description(&system(&wire("damper", "f", "inner", "speed")), NESTED_REST),
        &files,
    );
    let output = import(&folder, &twice, &[]);
    assert!(
        output.code == Some(2) && output.err.contains("speed` is fed by two connections"),
        "{output:?}"
    );
    let package = package(&folder, &description(&system(""), NESTED_REST), &files);
    let output = import(&folder, &package, &["--period", "2 ms"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    is_what_is_written_by_hand(
        &folder,
        r#"
        duration = "2 s"
        [participants.spring]
        period = "2 ms"
        run.fmu = "fmus/spring.fmu"
        [participants.brake-damper]
        period = "2 ms"
        run.fmu = "fmus/damper.fmu"
        [connections.speed]
        from = "spring.outputs"
        to = "brake-damper.inputs"
        map = { v = "v" }
        [connections.force]
        from = "brake-damper.outputs"
        to = "spring.inputs"
        map = { f = "f" }
        "#,
    );
}

/// A text goes from one FMU to another, and is a signal of both.
#[test]
fn texts_and_bytes_are_connected() {
    let folder = Folder::new("texts");
    let feedthrough = read(&root().join("tests/fmus/reference/fmi3/Feedthrough.fmu"));
    let component = |name: &str| {
        let connector = |kind: &str| {
            let each =
                ["String", "Binary"].map(|one| format!("<ssd:Connector name=\"{one}_{kind}\" kind=\"{kind}\"/>"));
            each.concat()
        };
        format!(
            "<ssd:Component name=\"{name}\" source=\"a.fmu\"><ssd:Connectors>{}{}</ssd:Connectors></ssd:Component>",
            connector("input"),
            connector("output")
        )
    };
    let wire = |one: &str| {
        format!(
            "<ssd:Connection startElement=\"one\" startConnector=\"{one}_output\" endElement=\"two\" endConnector=\"{one}_input\"/>"
        )
    };
    let system = format!(
        "<ssd:Elements>{}{}</ssd:Elements><ssd:Connections>{}{}</ssd:Connections>",
        component("one"),
        component("two"),
        wire("String"),
        wire("Binary")
    );
    let rest = "<ssd:DefaultExperiment startTime=\"0\" stopTime=\"1\"/>";
    let package = package(&folder, &description(&system, rest), &[("a.fmu", feedthrough)]);
    let output = import(&folder, &package, &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    let outputs = "outputs = [\"Float64_continuous_output\", \"Float64_discrete_output\", \"Int64_output\", \"UInt64_output\", \
                   \"Float32_continuous_output\", \"Float32_discrete_output\", \"Int32_output\", \"UInt32_output\", \"Int16_output\", \
                   \"UInt16_output\", \"Int8_output\", \"UInt8_output\", \"Boolean_output\", \"String_output\", \
                   \"Binary_output\", \"Enumeration_output\"]";
    is_what_is_written_by_hand(
        &folder,
        &format!(
            r#"
        duration = "1 s"
        [participants.one]
        period = "100 ms"
        run = {{ fmu = "fmus/a.fmu", ports = {{ inputs = [], {outputs} }} }}
        [participants.two]
        period = "100 ms"
        run = {{ fmu = "fmus/a.fmu", ports = {{ inputs = ["String_input", "Binary_input"] }} }}
        [connections.all]
        from = "one.outputs"
        to = "two.inputs"
        map = {{ String_input = "String_output", Binary_input = "Binary_output" }}
        "#
        ),
    );
}
