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
