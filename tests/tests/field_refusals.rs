//! Connections by fields that do not fit are rejected before anything runs, with key, value and remedy.

use escapement_tests::program::{Folder, ProgramOutput, root, run_orchestrator, text};

/// `wired.toml` with `sets` is rejected with each of these texts.
fn assert_refused(sets: &[&str], words: &[&str]) {
    let mut arguments = vec!["check", "examples/fmu/wired.toml"];
    sets.iter().for_each(|set| arguments.extend(["--set", set]));
    let output = run_orchestrator(&arguments);
    assert_eq!(output.code, Some(2), "{sets:?}: {output:?}");
    for word in words {
        assert!(output.err.contains(word), "{sets:?}: `{word}` is not in {}", output.err);
    }
}

#[test]
fn field_that_does_not_fit_is_refused_with_key_value_and_remedy() {
    let map = |map: &str| format!("connections.pull.map={map}");
    for (entry, words) in [
        (
            "{ position = \"h\", velocity = \"speed\" }",
            &["connections.pull.map", "no field or element `speed`", "`v: f64"][..],
        ),
        (
            "{ place = \"h\", velocity = \"v\" }",
            &["no field or element `place`", "`position: f64 in m, frame N`"],
        ),
        (
            "{ position = \"v\", velocity = \"v\" }",
            &[
                "`v: f64 in m/s, frame N` does not become `position: f64 in m, frame N`",
                "dimension",
                "factor",
            ],
        ),
        (
            "{ position = \"h\" }",
            &[
                "`mass.neighbour` is not fed in full",
                "`velocity` is missing",
                "map = { \"velocity\" = 0 }",
            ],
        ),
        (
            "{ position = { from = \"h\", factor = true }, velocity = \"v\" }",
            &["factor `true` is not a number"],
        ),
        (
            "{ position = { from = \"h\", offset = 3 }, velocity = \"v\" }",
            &["the offset `3` has no unit", "3 m"],
        ),
        (
            "{ position = { from = \"h\", times = 3 }, velocity = \"v\" }",
            &["`position`", "unknown field `times`"],
        ),
        ("{ position = { factor = 3 }, velocity = \"v\" }", &["give it `from`"]),
        (
            "{ position = true, velocity = \"v\" }",
            &["the value `true` is neither a number nor a list of numbers"],
        ),
        (
            "{ position = [\"h\", 3], velocity = \"v\" }",
            &["what a sum adds up are fields"],
        ),
        ("{}", &["is empty"]),
        ("7", &["`7` is not a map", "by-name"]),
        ("\"by-name\"", &["no field or element `position`"]),
    ] {
        assert_refused(&[&map(entry)], words);
    }
}

#[test]
fn connection_by_fields_that_contradicts_itself_is_refused() {
    let whole = "connections.pull.to=mass.neighbour";
    for (sets, words) in [
        (
            &["connections.where.to=gauge.inputs"][..],
            &[
                "connections.where.to",
                "names the port `gauge.inputs`",
                "`position`: name its field too",
            ][..],
        ),
        (
            &["connections.where.from=mass.motion"],
            &[
                "connections.where.from",
                "`Float64_continuous_input`: name its field too",
            ],
        ),
        (
            &["connections.where.map=\"by-name\""],
            &["connections.where.map", "stands beside a field"],
        ),
        (
            &["connections.pull.factor=2"],
            &["connections.pull.factor", "belongs to one field"],
        ),
        (
            &["connections.power-of-ball.sum=false"],
            &[
                "`gauge.inputs.Float64_discrete_input` is fed twice",
                "`power-of-ball`",
                "`power-of-mass`",
                "sum = true",
            ],
        ),
        (
            &[
                whole,
                "connections.more={ from = \"ball.outputs\", to = \"mass.neighbour\", map = { position = \"h\" } }",
            ],
            &["`mass.neighbour.position` is fed twice"],
        ),
        (
            &["connections.more={ from = \"mass.motion\", to = \"mass.neighbour\" }"],
            &["`mass.neighbour` is fed twice, by connections `more` and `pull`"],
        ),
        (
            &["connections.where.initial={ Float64_discrete_input = 1.0 }"],
            &[
                "connections.where.initial",
                "`Float64_discrete_input` is not fed by this connection",
            ],
        ),
        (&["connections.pull.frames=none"], &["connections.pull.frames", "any"]),
        (
            &["participants.ball.run.ports={ outputs = [{ variable = \"h\", frame = \"B\" }, \"v\"] }"],
            &["frame B", "frame N", "frames = \"any\""],
        ),
        (
            &["connections.where.from=mass..position"],
            &["connections.where.from", "`mass..position` is not a port"],
        ),
    ] {
        assert_refused(sets, words);
    }
    let frames = "participants.ball.run.ports={ outputs = [{ variable = \"h\", frame = \"B\" }, \"v\"] }";
    let any = [
        "check",
        "examples/fmu/wired.toml",
        "--set",
        frames,
        "--set",
        "connections.pull.frames=any",
    ];
    let output = run_orchestrator(&any);
    assert_eq!(output.code, Some(0), "{output:?}");
    assert!(output.out.contains("(frame B to frame N)"), "{output:?}");
}

/// A gauge whose inputs have many types, fed by another one.
fn types(map: &str) -> ProgramOutput {
    let folder = Folder::new("fields-types");
    let gauge = root().join("tests/fmus/reference/fmi3/Feedthrough.fmu");
    let scenario = folder.write(
        "types.toml",
        &format!(
            "duration = \"1 s\"\n[participants.a]\nperiod = \"100 ms\"\nrun = {{ fmu = \"{0}\", ports = {{ inputs = [] }} }}\n\
             [participants.b]\nperiod = \"100 ms\"\nrun = {{ fmu = \"{0}\", ports = {{ inputs = [{1}] }} }}\n\
             [connections.all]\nfrom = \"a.outputs\"\nto = \"b.inputs\"\nmap = {{ {map} }}\n",
            text(&gauge),
            format_args!("\"{}\"", map.split(' ').next().unwrap_or_default())
        ),
    );
    run_orchestrator(&["check", text(&scenario)])
}

#[test]
fn types_are_converted_where_no_value_is_lost() {
    for map in [
        "Float64_continuous_input = \"Float32_continuous_output\"",
        "Float64_continuous_input = \"Int32_output\"",
        "Int64_input = \"UInt32_output\"",
        "Int32_input = \"Boolean_output\"",
        "Float32_continuous_input = { from = \"UInt8_output\", factor = 0.5 }",
        "Int64_input = { value = 9007199254740991 }",
        "UInt8_input = 255",
    ] {
        let output = types(map);
        assert_eq!(output.code, Some(0), "{map}: {output:?}");
    }
    for (map, words) in [
        (
            "Float32_continuous_input = \"Float64_continuous_output\"",
            "f32 does not hold every value of f64; make the input f64",
        ),
        (
            "Float64_continuous_input = \"Int64_output\"",
            "f64 does not hold every value of i64",
        ),
        (
            "UInt32_input = \"Int32_output\"",
            "u32 does not hold every value of i32",
        ),
        (
            "Int32_input = { from = \"Int32_output\", factor = 2 }",
            "values that are taken over as they are",
        ),
        (
            "Int32_input = [\"Int32_output\", \"Int8_output\"]",
            "taken over as they are",
        ),
        ("UInt8_input = 256", "cannot always be 256"),
        ("Int32_input = 0.5", "cannot always be 0.5"),
        ("Float64_continuous_input = nan", "is"),
    ] {
        let output = types(map);
        assert!(
            output.code == Some(2) && output.err.contains(words) && output.err.contains("types.toml:"),
            "{map}: {output:?}"
        );
    }
}
