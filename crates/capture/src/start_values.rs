//! Warnings about start values of the stock plant that are changed in a run from a checkpoint, whose state already stands.

use engine::scenario::{Entry, Program, Scenario};
use toml::Value;

/// Keys that the plant reads at its start only.
const KEYS: [&[&str]; 3] = [
    &["start"],
    &["target_start"],
    &["actuators", "wheels", "start_momentum"],
];

/// Warnings about start values of `scenario`, which continues a run of `unchanged`, that differ from those of that run.
pub fn warnings(scenario: &Scenario, unchanged: &Scenario) -> Vec<String> {
    let plants = scenario
        .participants
        .iter()
        .filter(|entry| entry.program == Program::Builtin("plant".to_owned()));
    let of_plant = |plant: &Entry| {
        let before = unchanged
            .participants
            .iter()
            .find(|entry| entry.setup.name == plant.setup.name);
        let changed = KEYS.iter().filter(|key| {
            let former = before.and_then(|before| lookup(before, key));
            before.is_some() && lookup(plant, key) != former
        });
        let reason =
            "a value of the start has no effect on a run that continues from a checkpoint; change it in a new run";
        let warnings = changed.map(|key| scenario.refusal(plant, &key.join("."), reason).to_string());
        warnings.collect::<Vec<_>>()
    };
    plants.flat_map(of_plant).collect()
}

fn lookup<'a>(entry: &'a Entry, key: &[&str]) -> Option<&'a Value> {
    let (first, rest) = key.split_first()?;
    rest.iter()
        .try_fold(entry.setup.parameters.get(*first)?, |value, part| value.get(*part))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::close_scenario::close_with;

    #[test]
    fn changed_start_values_are_warned_of_at_their_keys() {
        let unchanged = close_with(&[]);
        assert_eq!(warnings(&close_with(&[]), &unchanged), Vec::<String>::new());
        assert_eq!(
            warnings(&close_with(&["target.mass=200 kg"]), &unchanged),
            Vec::<String>::new()
        );
        for (change, key) in [
            ("start.position=[5, 5, 5] m", "start"),
            ("target_start.rate=[1, 0, 0] deg/s", "target_start"),
            (
                "actuators.wheels.start_momentum=1 N m s",
                "actuators.wheels.start_momentum",
            ),
        ] {
            let found = warnings(&close_with(&[change]), &unchanged);
            let named = format!("participants.plant.parameters.{key}: ");
            assert!(found.len() == 1 && found[0].contains(&named), "{found:?}");
        }
    }
}
