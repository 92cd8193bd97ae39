//! System structures are imported as scenarios, which run and whose tapes equal those of handwritten scenarios.

use escapement_tests::packages::{
    NESTED_REST, SPACES, description, import, is_what_is_written_by_hand, package, pair, read,
};
use escapement_tests::program::{Folder, root};

/// Units and a transformation on the path through a nested system, a parameter set with a prefix, another one with a mapping, and a
/// parameter that passes through connectors.
const NESTED: &str = r#"
<ssd:Connectors>
  <ssd:Connector name="D" kind="parameter"><ssc:Real unit="N.s/mm"/></ssd:Connector>
  <ssd:Connector name="idle" kind="input"/>
  <ssd:Connector name="position" kind="output"/>
</ssd:Connectors>
<ssd:ParameterBindings>
  <ssd:ParameterBinding source="resources/mass.ssv" prefix="mass."/>
  <ssd:ParameterBinding source="resources/plant%20data.ssv">
    <ssd:ParameterMapping source="resources/plant.ssm"/>
  </ssd:ParameterBinding>
</ssd:ParameterBindings>
<ssd:Elements>
  <ssd:Component name="mass" type="application/x-fmu-sharedlibrary" source="resources/spring.fmu">
    <ssd:Connectors>
      <ssd:Connector name="f" kind="input"/><ssd:Connector name="x" kind="output"/><ssd:Connector name="v" kind="output"/>
    </ssd:Connectors>
    <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
      <ssv:ParameterSet version="1.0" name="overridden from above"><ssv:Parameters>
        <ssv:Parameter name="x"><ssv:Real value="0.7"/></ssv:Parameter>
      </ssv:Parameters></ssv:ParameterSet>
    </ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
  </ssd:Component>
  <ssd:System name="brake">
    <ssd:Connectors>
      <ssd:Connector name="speed" kind="input"><ssc:Real unit="mm/s"/></ssd:Connector>
      <ssd:Connector name="force" kind="output"/>
      <ssd:Connector name="c" kind="parameter"/>
    </ssd:Connectors>
    <ssd:Elements>
      <ssd:Component name="damper" source="resources/damper.fmu" implementation="CoSimulation">
        <ssd:Connectors>
          <ssd:Connector name="v" kind="input"/><ssd:Connector name="f" kind="output"/><ssd:Connector name="damping" kind="parameter"/>
        </ssd:Connectors>
      </ssd:Component>
    </ssd:Elements>
    <ssd:Connections>
      <ssd:Connection startConnector="speed" endElement="damper" endConnector="v">
        <ssc:LinearTransformation offset="0.01"/>
      </ssd:Connection>
      <ssd:Connection startConnector="force" endElement="damper" endConnector="f"/>
      <ssd:Connection startConnector="c" endElement="damper" endConnector="damping"/>
    </ssd:Connections>
  </ssd:System>
</ssd:Elements>
<ssd:Connections>
  <ssd:Connection startElement="mass" startConnector="v" endElement="brake" endConnector="speed">
    <ssc:LinearTransformation factor="0.5"/>
  </ssd:Connection>
  <ssd:Connection startElement="brake" startConnector="force" endElement="mass" endConnector="f"/>
  <ssd:Connection startConnector="D" endElement="brake" endConnector="c"/>
  <ssd:Connection startElement="mass" startConnector="x" endConnector="position"/>
</ssd:Connections>"#;

#[test]
fn nested_system_is_the_scenario_written_by_hand() {
    let folder = Folder::new("nested");
    let (spring, damper) = pair(&folder);
    let set = |content: &str| {
        format!("<ssv:ParameterSet {SPACES} version=\"1.0\" name=\"p\">{content}</ssv:ParameterSet>").into_bytes()
    };
    let of_mass = set(
        "<ssv:Parameters><ssv:Parameter name=\"x\"><ssv:Real value=\"200\" unit=\"mm\"/></ssv:Parameter>\
         <ssv:Parameter name=\"elsewhere\"><ssv:Real value=\"1\"/></ssv:Parameter></ssv:Parameters>\
         <ssv:Units><ssc:Unit name=\"mm\"><ssc:BaseUnit m=\"1\" factor=\"0.001\"/></ssc:Unit></ssv:Units>",
    );
    let of_plant = set(
        "<ssv:Parameters><ssv:Parameter name=\"M\"><ssv:Real value=\"2000\" unit=\"g\"/></ssv:Parameter>\
         <ssv:Parameter name=\"K\"><ssv:Integer value=\"12\"/></ssv:Parameter><ssv:Parameter name=\"D\"><ssv:Real value=\"9\"/></ssv:Parameter>\
         <ssv:Parameter name=\"damping\"><ssv:Real value=\"0.0005\"/></ssv:Parameter></ssv:Parameters>\
         <ssv:Units><ssc:Unit name=\"g\"><ssc:BaseUnit kg=\"1\" factor=\"0.001\"/></ssc:Unit></ssv:Units>",
    );
    let mapping = format!(
        "<ssm:ParameterMapping {SPACES} version=\"1.0\"><ssm:MappingEntry source=\"M\" target=\"mass.mass\"/>\
         <ssm:MappingEntry source=\"K\" target=\"mass.stiffness\"><ssc:LinearTransformation factor=\"2\" offset=\"1\"/></ssm:MappingEntry>\
         <ssm:MappingEntry source=\"damping\" target=\"D\"/></ssm:ParameterMapping>"
    );
    let files = [
        ("resources/spring.fmu", spring),
        ("resources/damper.fmu", damper),
        ("resources/mass.ssv", of_mass),
        ("resources/plant data.ssv", of_plant),
        ("resources/plant.ssm", mapping.into_bytes()),
    ];
    let package = package(&folder, &description(NESTED, NESTED_REST), &files);
    let output = import(&folder, &package, &["--period", "2 ms"]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.out.contains("fmus/spring.fmu") && output.out.contains("What to do next"),
        "{output:?}"
    );
    assert!(
        output
            .err
            .contains("resources/mass.ssv:1: there is no parameter `mass.elsewhere`"),
        "{output:?}"
    );
    is_what_is_written_by_hand(
        &folder,
        r#"
        duration = "2 s"
        [participants.mass]
        period = "2 ms"
        run.fmu = "fmus/spring.fmu"
        parameters = { x = "200 mm", mass = "2 kg", stiffness = "25 N/m" }
        [participants.brake-damper]
        period = "2 ms"
        run.fmu = "fmus/damper.fmu"
        parameters = { damping = "0.5 N s/m" }
        [connections.speed]
        from = "mass.outputs"
        to = "brake-damper.inputs"
        map = { v = { from = "v", factor = 0.5, offset = "1 cm/s" } }
        [connections.force]
        from = "brake-damper.outputs"
        to = "mass.inputs"
        map = { f = "f" }
        "#,
    );
    let scenario = String::from_utf8(read(&folder.path().join("imported/scenario.toml"))).expect("text");
    assert!(scenario.contains("curves = [\"mass.outputs.x\"]"), "{scenario}");
}

/// Whole numbers, truth values and enumerations between FMUs of other tools, SSP 2.0 with a default namespace, no nesting, values in
/// the description, tables for values, an experiment that starts later, and no unit anywhere.
const TYPES: &str = r#"<?xml version="1.0" encoding="UTF-8"?>
<SystemStructureDescription xmlns="http://ssp-standard.org/SSP1/SystemStructureDescription" version="2.0" name="Types"
  xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues"
  xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping">
<System name="root">
  <Connectors><Connector name="level" kind="input"><ssc:Float64/></Connector></Connectors>
  <ParameterBindings><ParameterBinding>
    <ParameterValues><ssv:ParameterSet version="2.0" name="start"><ssv:Parameters>
      <ssv:Parameter name="level"><ssv:Float64 value="2.5"/></ssv:Parameter>
      <ssv:Parameter name="one.two.Int32_input"><ssv:Int32 value="-7"/></ssv:Parameter>
      <ssv:Parameter name="off"><ssv:Boolean value="0"/></ssv:Parameter>
      <ssv:Parameter name="choice"><ssv:Enumeration value="first"/></ssv:Parameter>
      <ssv:Parameter name="one.two.String_input"><ssv:String value="a &quot;b&quot; \ &#10;c"/></ssv:Parameter>
    </ssv:Parameters></ssv:ParameterSet></ParameterValues>
    <ParameterMapping><ssm:ParameterMapping version="2.0">
      <ssm:MappingEntry source="level" target="level"/>
      <ssm:MappingEntry source="one.two.Int32_input" target="one.two.Int32_input">
        <ssc:IntegerMappingTransformation><ssc:MapEntry source="-7" target="41"/></ssc:IntegerMappingTransformation>
      </ssm:MappingEntry>
      <ssm:MappingEntry source="off" target="one.two.Boolean_input">
        <ssc:BooleanMappingTransformation><ssc:MapEntry source="false" target="true"/></ssc:BooleanMappingTransformation>
      </ssm:MappingEntry>
      <ssm:MappingEntry source="choice" target="one.two.Enumeration_input">
        <ssc:EnumerationMappingTransformation><ssc:MapEntry source="first" target="Option 2"/></ssc:EnumerationMappingTransformation>
      </ssm:MappingEntry>
      <ssm:MappingEntry source="one.two.String_input" target="one.two.String_input"/>
    </ssm:ParameterMapping></ParameterMapping>
  </ParameterBinding></ParameterBindings>
  <Elements>
    <Component name="one.two" source="./Feedthrough.fmu"><Connectors>
      <Connector name="Float64_continuous_input" kind="input"/><Connector name="Float64_continuous_output" kind="output"/>
      <Connector name="Int32_output" kind="output"/><Connector name="Boolean_output" kind="output"/>
      <Connector name="Enumeration_output" kind="output"/>
    </Connectors></Component>
    <Component name="3" source="./Feedthrough.fmu"><Connectors>
      <Connector name="Float64_continuous_input" kind="input"/><Connector name="Float64_discrete_input" kind="input"/>
      <Connector name="Int32_input" kind="input"/><Connector name="Boolean_input" kind="input"/><Connector name="Enumeration_input" kind="input"/>
      <Connector name="Float64_continuous_output" kind="output"/>
    </Connectors></Component>
  </Elements>
  <Connections>
    <Connection startConnector="level" endElement="one.two" endConnector="Float64_continuous_input">
      <ssc:LinearTransformation factor="-2" offset="1"/></Connection>
    <Connection startElement="one.two" startConnector="Int32_output" endElement="3" endConnector="Int32_input"/>
    <Connection startElement="one.two" startConnector="Int32_output" endElement="3" endConnector="Float64_discrete_input">
      <ssc:LinearTransformation factor="0.25"/></Connection>
    <Connection startElement="one.two" startConnector="Boolean_output" endElement="3" endConnector="Boolean_input"/>
    <Connection startElement="3" startConnector="Enumeration_input" endElement="one.two" endConnector="Enumeration_output"/>
    <Connection startElement="one.two" startConnector="Float64_continuous_output" endElement="3" endConnector="Float64_continuous_input"/>
  </Connections>
</System>
<DefaultExperiment startTime="0.5" stopTime="1.5"/>
</SystemStructureDescription>"#;

#[test]
fn system_of_another_kind_is_its_scenario_too() {
    let folder = Folder::new("types");
    let feedthrough = read(&root().join("tests/fmus/reference/fmi3/Feedthrough.fmu"));
    let package = package(&folder, TYPES, &[("Feedthrough.fmu", feedthrough)]);
    let output = import(&folder, &package, &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(
        output.err.contains("`one.two` has outputs with direct feedthrough"),
        "{output:?}"
    );
    is_what_is_written_by_hand(
        &folder,
        r#"
        duration = "1.5 s"
        [participants.one-two]
        period = "100 ms"
        offset = "500 ms"
        run = { fmu = "fmus/Feedthrough.fmu", ports = { inputs = [] } }
        [participants.one-two.parameters]
        Float64_continuous_input = -4.0
        Int32_input = 41
        Boolean_input = true
        Enumeration_input = "Option 2"
        String_input = "a \"b\" \\ \nc"
        [participants.fmu-3]
        period = "100 ms"
        offset = "500 ms"
        [participants.fmu-3.run]
        fmu = "fmus/Feedthrough.fmu"
        ports.inputs = ["Float64_continuous_input", "Float64_discrete_input", "Int32_input", "Boolean_input", "Enumeration_input"]
        [connections.all]
        from = "one-two.outputs"
        to = "fmu-3.inputs"
        [connections.all.map]
        Float64_continuous_input = "Float64_continuous_output"
        Float64_discrete_input = { from = "Int32_output", factor = 0.25 }
        Enumeration_input = "Enumeration_output"
        Int32_input = "Int32_output"
        Boolean_input = "Boolean_output"
        "#,
    );
}

/// Connectors and parameters by an alias: the generated scenario has the variable's own name.
#[test]
fn alias_is_the_variable_that_it_names() {
    let folder = Folder::new("ssp-alias");
    let system = |values: &str| {
        format!(
            r#"<ssd:Connectors><ssd:Connector name="height" kind="output"/></ssd:Connectors>
<ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues><ssv:ParameterSet version="1.0" name="p"><ssv:Parameters>
{values}
</ssv:Parameters></ssv:ParameterSet></ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
<ssd:Elements><ssd:Component name="ball" source="ball.fmu"><ssd:Connectors><ssd:Connector name="h_ft" kind="output"/></ssd:Connectors>
</ssd:Component><ssd:Component name="gauge" source="gauge.fmu"><ssd:Connectors>
<ssd:Connector name="Float64_continuous_input" kind="input"/></ssd:Connectors></ssd:Component></ssd:Elements>
<ssd:Connections>
<ssd:Connection startElement="ball" startConnector="h_ft" endElement="gauge" endConnector="Float64_continuous_input"/>
<ssd:Connection startElement="ball" startConnector="h_ft" endConnector="height"/></ssd:Connections>"#
        )
    };
    let fmu = |model: &str| read(&root().join(format!("tests/fmus/reference/fmi3/{model}.fmu")));
    let files = [("ball.fmu", fmu("BouncingBall")), ("gauge.fmu", fmu("Feedthrough"))];
    let rest = r#"<ssd:DefaultExperiment startTime="0" stopTime="1"/>"#;
    let value = |name: &str| format!(r#"<ssv:Parameter name="ball.{name}"><ssv:Real value="2"/></ssv:Parameter>"#);
    let twice = package(
        &folder,
        &description(&system(&(value("h") + &value("h_ft"))), rest),
        &files,
    );
    let output = import(&folder, &twice, &[]);
    assert_eq!(output.code, Some(2), "{output:?}");
    assert!(
        output
            .err
            .contains("`h` of the FMU has a value already, by another of its names"),
        "{output:?}"
    );
    let package = package(&folder, &description(&system(&value("h_ft")), rest), &files);
    let output = import(&folder, &package, &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    is_what_is_written_by_hand(
        &folder,
        r#"
        duration = "1 s"
        [participants.ball]
        period = "10 ms"
        run.fmu = "fmus/ball.fmu"
        parameters = { h = "2 m" }
        [participants.gauge]
        period = "100 ms"
        run = { fmu = "fmus/gauge.fmu", ports = { inputs = ["Float64_continuous_input"] } }
        [connections.height]
        from = "ball.outputs.h"
        to = "gauge.inputs.Float64_continuous_input"
        factor = "1 1/m"
        "#,
    );
}

/// The example of the documentation, which is a folder.
#[test]
fn unpacked_system_is_imported_too() {
    let folder = Folder::new("unpacked");
    let output = import(&folder, &root().join("examples/fmu/system"), &[]);
    assert_eq!(output.code, Some(0), "{output:?}");
    is_what_is_written_by_hand(
        &folder,
        r#"
        duration = "2 s"
        [participants.drop-ball]
        period = "10 ms"
        run.fmu = "fmus/ball.fmu"
        parameters = { h = "50 cm", e = 0.6 }
        [participants.gauge]
        period = "10 ms"
        run = { fmu = "fmus/gauge.fmu", ports = { inputs = ["Float64_continuous_input"] } }
        [connections.height]
        from = "drop-ball.outputs.h"
        to = "gauge.inputs.Float64_continuous_input"
        factor = "100 1/m"
        offset = 2.0
        "#,
    );
}
