//! Tests of settings on descriptions of a few variables.

use super::*;
use crate::layout::Layout;
use crate::options::Options;

fn described(variables: &str) -> Description {
    let text = format!(
        r#"<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">
             <CoSimulation modelIdentifier="m"/>
             <UnitDefinitions>
               <Unit name="degC"><BaseUnit K="1" offset="273.15"/></Unit>
               <Unit name="%"><BaseUnit factor="0.01"/></Unit>
               <Unit name="s"><BaseUnit s="1"/></Unit>
               <Unit name="1"><BaseUnit/></Unit>
             </UnitDefinitions>
             <TypeDefinitions>
               <Float64Type name="Difference" unit="degC" relativeQuantity="true"/>
             </TypeDefinitions>
             <ModelVariables>{variables}</ModelVariables>
           </fmiModelDescription>"#
    );
    Description::read(&text).unwrap()
}

fn set(about: &Description, parameters: &str) -> Result<f64, String> {
    let table: Table = toml::from_str(parameters).unwrap();
    let settings = Settings::read(about, &table).map_err(|error| error.to_string())?;
    match &settings.start[0].value {
        Content::Numbers(values) => Ok(f64::from_ne_bytes(values.bytes(0))),
        other => panic!("{other:?}"),
    }
}

#[test]
fn unit_offset_does_not_apply_to_relative_quantity() {
    let about = described(
        r#"<Float64 name="t" valueReference="1" causality="parameter" unit="degC"/>
           <Float64 name="d" valueReference="2" causality="parameter" unit="degC" relativeQuantity="true"/>
           <Float64 name="typed" valueReference="3" causality="parameter" declaredType="Difference"/>
           <Float64 name="own" valueReference="4" causality="parameter" declaredType="Difference" relativeQuantity="false"/>
           <Float64 name="u" valueReference="5" causality="input" unit="degC" relativeQuantity="true"/>"#,
    );
    for (name, value) in [
        ("t", 10.0 - 273.15),
        ("d", 10.0),
        ("typed", 10.0),
        ("own", 10.0 - 273.15),
    ] {
        assert_eq!(set(&about, &format!("{name} = '10 K'")), Ok(value), "{name}");
        assert_eq!(set(&about, &format!("{name} = '10 degC'")), Ok(10.0), "{name}");
    }
    let layout = Layout::new(&about, &Options::default(), &Settings::default()).unwrap();
    assert_eq!(layout.interface.inputs[0].descriptor.fields[0].unit, "K");
    assert!(layout.inputs[0].slots.is_empty(), "the port's values are copied");
}

#[test]
fn parameter_given_twice_is_refused() {
    let about = described(r#"<Float64 name="inner.k" valueReference="1" causality="parameter"/>"#);
    assert_eq!(set(&about, "inner = { k = 2 }"), Ok(2.0));
    assert_eq!(set(&about, "'inner.k' = 3.0"), Ok(3.0));
    let error = set(&about, "inner = { k = 2.0 }\n'inner.k' = 3.0").unwrap_err();
    for part in ["`inner.k`: ", "`inner.k = 2.0`", "`\"inner.k\" = 3.0`", "remove one"] {
        assert!(error.contains(part), "{error}");
    }
}

#[test]
fn alias_sets_its_variable_and_counts_as_its_value() {
    let three = described(
        r#"<Float64 name="h" valueReference="1" causality="parameter"><Alias name="h_ft" displayUnit="ft"/><Alias name="in.h"/></Float64>"#,
    );
    assert_eq!(set(&three, "h_ft = 2.0"), Ok(2.0));
    assert_eq!(set(&three, "in = { h = 3.0 }"), Ok(3.0));
    let error = set(&three, "h = 1.0\nh_ft = 2.0").unwrap_err();
    for part in [
        "`h_ft`: ",
        "`h` and `h_ft` are one value",
        "`h = 1.0`",
        "`h_ft = 2.0`",
        "remove one",
    ] {
        assert!(error.contains(part), "`{part}` is not in {error}");
    }
    let error = set(&three, "h_fd = 2.0").unwrap_err();
    assert!(error.contains("did you mean `h_ft`?"), "{error}");
    // In FMI 2.0 an alias is a variable with the same reference, and each type has its own references.
    let two = r#"<fmiModelDescription fmiVersion="2.0" modelName="m" guid="t"><CoSimulation modelIdentifier="m"/><ModelVariables>
        <ScalarVariable name="a" valueReference="1" causality="parameter" variability="fixed"><Real start="1"/></ScalarVariable>
        <ScalarVariable name="b" valueReference="1" causality="parameter" variability="fixed"><Real start="1"/></ScalarVariable>
        <ScalarVariable name="n" valueReference="1" causality="parameter" variability="fixed"><Integer start="1"/></ScalarVariable>
        </ModelVariables></fmiModelDescription>"#;
    let two = Description::read(two).unwrap();
    assert_eq!(set(&two, "b = 2.0\nn = 3"), Ok(2.0));
    let error = set(&two, "a = 1.0\nb = 2.0").unwrap_err();
    assert!(error.contains("`a` and `b` are one value"), "{error}");
    // A generated scenario has each value once.
    let written: Vec<String> = (crate::inspect::parameter_entries(&two).into_iter())
        .map(|(name, _)| name)
        .collect();
    assert_eq!(written, ["a", "n"]);
}

#[test]
fn alias_names_field_without_adding_one() {
    let about = described(
        r#"<Float64 name="h" valueReference="1" causality="output"><Alias name="h_ft" description="in feet"/></Float64>
           <Float64 name="u" valueReference="2" causality="input"><Alias name="pull"/></Float64>"#,
    );
    assert_eq!(about.variables[0].aliases[0].text, "in feet");
    let ports = |options: &str| {
        let options = Options::read(&toml::from_str(options).unwrap()).unwrap();
        Layout::new(&about, &options, &Settings::default()).map_err(|error| error.to_string())
    };
    let plain = ports("").unwrap();
    let names = |layout: &Layout| layout.interface.outputs[0].descriptor.fields[0].name.clone();
    assert_eq!(names(&plain), "h");
    assert_eq!(plain.aliases.field("outputs", "h_ft").as_deref(), Some("h"));
    assert_eq!(plain.aliases.field("inputs", "pull").as_deref(), Some("u"));
    let named = ports("ports = { motion = ['h_ft'] }").unwrap();
    assert_eq!(names(&named), "h_ft");
    assert_eq!(named.aliases.field("motion", "h").as_deref(), Some("h_ft"));
    // A field with a name that the user chose has only this one, and a name of a field is no alias of another.
    let chosen = ports("ports = { motion = [{ name = 'height', variable = 'h_ft' }, 'h'] }").unwrap();
    assert_eq!(chosen.aliases.field("motion", "height"), None);
    assert_eq!(chosen.aliases.field("motion", "h_ft").as_deref(), Some("h"));
    let twice = ports("ports = { inputs = ['u', 'pull'] }").unwrap_err();
    assert!(twice.contains("the input `u` stands in two fields"), "{twice}");
    let unknown = ports("record = ['h_fd']").unwrap_err();
    assert!(unknown.contains("did you mean `h_ft`?"), "{unknown}");
}

#[test]
fn name_of_an_alias_is_unique() {
    for variables in [
        r#"<Float64 name="a" valueReference="1"><Alias name="b"/></Float64><Float64 name="b" valueReference="2"/>"#,
        r#"<Float64 name="b" valueReference="2"/><Float64 name="a" valueReference="1"><Alias name="b"/></Float64>"#,
        r#"<Float64 name="b" valueReference="2"><Alias name="b"/></Float64>"#,
        r#"<Float64 name="a" valueReference="1"><Alias name="b"/><Alias name="b"/></Float64>"#,
    ] {
        let text = format!(
            "<fmiModelDescription fmiVersion='3.0' modelName='m' instantiationToken='t'><CoSimulation modelIdentifier='m'/>\n\
             <ModelVariables>{variables}</ModelVariables></fmiModelDescription>"
        );
        let error = Description::read(&text).unwrap_err().to_string();
        assert!(
            error.contains("modelDescription.xml:2: the variable `b` is there twice"),
            "{error}"
        );
    }
}

#[test]
fn number_beyond_its_type_is_refused() {
    let about = described(
        r#"<Float32 name="single" valueReference="1" causality="parameter"/>
           <Float64 name="share" valueReference="2" causality="parameter" unit="%"/>"#,
    );
    for wrong in ["single = 1e39", "single = -1e39", "share = '1e308 1'"] {
        let error = set(&about, wrong).unwrap_err();
        assert!(error.contains("is no Float") && error.contains("from -"), "{error}");
    }
    assert!(set(&about, "single = 3.4e38").is_ok());
}

#[test]
fn dimensionless_unit_with_factor_is_required() {
    let about = described(
        r#"<Float64 name="share" valueReference="1" causality="parameter" unit="%" start="0.5"/>
           <Float64 name="pure" valueReference="2" causality="parameter" unit="1" start="0.5"/>"#,
    );
    let error = set(&about, "share = 0.5").unwrap_err();
    assert!(
        error.contains("0.5 has no unit") && error.contains("\"0.5 %\""),
        "{error}"
    );
    assert_eq!(set(&about, "pure = 0.5"), Ok(0.5));
    // Generated scenarios say it too.
    let written = crate::inspect::parameter_entries(&about);
    assert_eq!(written[0].1, Value::String("0.5 %".into()));
    assert_eq!(written[1].1, Value::Float(0.5));
    assert!(Settings::read(&about, &written.into_iter().collect()).is_ok());
}

#[test]
fn unit_is_whole_text_after_number() {
    let about = described(
        r#"<Float64 name="time" valueReference="1" causality="parameter" unit="s"/>
           <Float64 name="share" valueReference="2" causality="parameter" unit="%"/>
           <Float64 name="pure" valueReference="3" causality="parameter" unit="1"/>"#,
    );
    for wrong in ["5 1/s", "5 m s"] {
        let error = set(&about, &format!("time = '{wrong}'"));
        assert!(
            error.clone().is_err_and(|error| error.contains(wrong)),
            "{wrong}: {error:?}"
        );
    }
    assert!(set(&about, "pure = '0.1'").is_err());
    for (right, value) in [
        ("time = '5 s'", 5.0),
        ("time = ' -5e1s '", -50.0),
        ("time = '5 ms'", 5e-3),
        ("share = '5%'", 5.0),
        ("share = '0.5 1'", 50.0),
        ("pure = '0.1 1'", 0.1),
    ] {
        assert_eq!(set(&about, right), Ok(value), "{right}");
    }
}

#[test]
fn array_without_elements_is_in_no_default_port_and_is_refused_by_name() {
    let about = described(
        r#"<UInt64 name="n" valueReference="1" causality="structuralParameter" variability="fixed" start="0"/>
           <Float64 name="all" valueReference="2" causality="output"><Dimension valueReference="1"/></Float64>
           <Float64 name="y" valueReference="3" causality="output"/>"#,
    );
    let fields = |parameters: &str, options: &str| {
        let settings = Settings::read(&about, &toml::from_str(parameters).unwrap()).unwrap();
        let options = Options::read(&toml::from_str(options).unwrap()).unwrap();
        let layout = Layout::new(&about, &options, &settings).map_err(|error| error.to_string())?;
        let fields = layout.interface.outputs[0].descriptor.fields.iter();
        Ok::<Vec<String>, String>(fields.map(|field| field.name.clone()).collect())
    };
    assert_eq!(fields("", "").unwrap(), ["y"]);
    assert_eq!(fields("n = 2", "").unwrap(), ["all", "y"]);
    let error = fields("", "ports.outputs = [\"all\"]").unwrap_err();
    assert!(
        error.contains("`all`: it is an array without elements") && error.contains("leave it out"),
        "{error}"
    );
}

#[test]
fn binary_longer_than_its_size_is_refused() {
    let about =
        described(r#"<Binary name="b" valueReference="1" causality="parameter" variability="fixed" maxSize="2"/>"#);
    let read = |text: &str| Settings::read(&about, &toml::from_str(text).unwrap());
    assert!(read("b = \"0102\"").is_ok());
    let error = read("b = \"010203\"").unwrap_err().to_string();
    assert!(
        error.contains("b") && error.contains("3 bytes; the FMU takes 2 at most"),
        "{error}"
    );
}

#[test]
fn forty_thousand_outputs_have_a_field_each() {
    let variables: String = (0..40_000)
        .map(|number| format!(r#"<Float64 name="y[{number}]" valueReference="{number}" causality="output"/>"#))
        .collect();
    let about = described(&variables);
    let layout = Layout::new(&about, &Options::default(), &Settings::default()).unwrap();
    let found = about
        .variables
        .iter()
        .filter(|one| about.variable(&one.name).is_some())
        .count();
    assert_eq!(
        (layout.interface.outputs[0].descriptor.fields.len(), found),
        (40_000, 40_000)
    );
}
