//! Warnings about events of the stock plant that a run does not reach: it survives a failure that never happens.

use engine::scenario::{Entry, Program, Scenario};
use lockstep::units::{Quantity, Time};
use toml::Value;

/// Warnings about failures of actuators that begin at or after the end, and about a gripper that is to close then.
pub fn warnings(scenario: &Scenario) -> Vec<String> {
    let plants = scenario
        .participants
        .iter()
        .filter(|entry| entry.program == Program::Builtin("plant".to_owned()));
    plants.flat_map(|plant| of_plant(scenario, plant)).collect()
}

fn of_plant(scenario: &Scenario, plant: &Entry) -> Vec<String> {
    let parameters = &plant.setup.parameters;
    let faults = parameters.get("faults").and_then(Value::as_array);
    let mut times: Vec<(String, Option<&Value>)> = faults
        .into_iter()
        .flatten()
        .enumerate()
        .map(|(at, fault)| (format!("faults[{at}].from"), fault.get("from")))
        .collect();
    let gripper = parameters.get("after_grasp").and_then(|gripper| gripper.get("at"));
    times.push(("after_grasp.at".to_owned(), gripper));
    let end = scenario.duration;
    let late = times.into_iter().filter_map(|(key, at)| {
        let at = at?;
        // a value that is no time is refused by the plant itself
        let seconds = at.clone().try_into::<Quantity<Time>>().ok()?.si();
        let text = at.as_str().filter(|_| seconds >= end.seconds())?;
        let reason = format!("{text} is not before the end at {end}: it does not happen in this run");
        Some(scenario.refusal(plant, &key, &reason).to_string())
    });
    late.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::close_scenario::close_with;

    fn found(changes: &[&str]) -> Vec<String> {
        warnings(&close_with(changes))
    }

    #[test]
    fn events_at_or_after_the_end_cause_a_warning() {
        let fault = |from: &str| format!("faults=[{{actuator='wheel.x',effect='off',from='{from}'}}]");
        for late in ["35 s", "0.6 min"] {
            let warnings = found(&[&fault(late)]);
            assert_eq!(warnings.len(), 1, "{warnings:?}");
            for part in [
                "participants.plant.parameters.faults",
                late,
                "not before the end at 35 s",
                "does not happen",
            ] {
                assert!(warnings[0].contains(part), "{warnings:?} without {part}");
            }
        }
        let warnings = found(&["after_grasp={at='40 s'}"]);
        assert!(
            warnings.len() == 1 && warnings[0].contains("after_grasp.at"),
            "{warnings:?}"
        );
        let within = found(&[&fault("34999 ms"), "after_grasp={at='30 s'}"]);
        assert_eq!(within, Vec::<String>::new());
        let from_the_start = found(&["faults=[{actuator='wheel.x',effect='off'}]"]);
        assert_eq!(from_the_start, Vec::<String>::new());
    }
}
