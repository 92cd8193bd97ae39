//! Limits and start values of variables that their types cannot represent.

use super::variable::Variable;

/// The attributes `min`, `max` and `start` of a variable that are no values of its type: what is wrong with each.
pub(super) fn invalid_literals(variable: &Variable) -> Vec<String> {
    let Variable { name, kind, range, .. } = variable;
    let mut found = Vec::new();
    let mut look = |attribute: &str, text: &str, effect: &str| {
        if !kind.holds(text) {
            let kind = kind.name();
            found.push(format!(
                "`{attribute}` of `{name}` is `{text}`, which is no {kind}, and is {effect}"
            ));
        }
    };
    let limits = [("min", &range.min), ("max", &range.max)];
    for (attribute, text) in limits {
        if let Some(text) = text {
            look(attribute, text, "not checked");
        }
    }
    if let Some(text) = variable.start.iter().find(|text| !kind.holds(text)) {
        look("start", text, "not used: set the value in `parameters`");
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::content::Description;

    #[test]
    fn literal_outside_its_type_is_reported() {
        let text = r#"<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">
             <CoSimulation modelIdentifier="m"/>
             <ModelVariables>
               <Float64 name="a" valueReference="1" causality="parameter" min="x" max="INF" start="1 2"/>
               <Int8 name="b" valueReference="2" causality="parameter" min="-128" max="1.5" start="300"/>
               <Float32 name="c" valueReference="3" causality="parameter" start="1e39"/>
               <Boolean name="d" valueReference="4" causality="parameter" start="yes"/>
               <Float64 name="fine" valueReference="5" causality="parameter" min="-1e3" max=" 2. " start="0.5"/>
               <UInt64 name="large" valueReference="6" causality="parameter" start="18446744073709551615"/>
               <String name="said" valueReference="7" causality="parameter"><Start value="x"/></String>
             </ModelVariables>
           </fmiModelDescription>"#;
        let about = Description::read(text).unwrap();
        let parts = [
            "`min` of `a` is `x`, which is no Float64",
            "`max` of `b` is `1.5`, which is no Int8",
            "`start` of `b` is `300`",
            "`start` of `c` is `1e39`, which is no Float32",
            "`start` of `d` is `yes`",
        ];
        for (problem, part) in about.problems.iter().zip(parts) {
            assert!(problem.contains(part), "{problem}");
        }
        assert_eq!(about.problems.len(), parts.len(), "{:?}", about.problems);
        // A generated scenario has only values that it accepts.
        let written: Vec<String> = (crate::inspect::parameter_entries(&about).into_iter())
            .map(|(name, _)| name)
            .collect();
        assert_eq!(written, ["a", "fine", "large", "said"]);
    }
}
