//! Campaign cases with every single failure of an actuator of the stock plant.

use std::path::Path;

use engine::campaign::{Cases, CasesError, Column, appended, builtin};
use engine::scenario::Scenario;
use lockstep::time::Rational;
use toml::{Table, Value};

/// A failure of one actuator.
struct Failure {
    actuator: String,
    effect: &'static str,
    /// The changes of the scenario that inform the controller of the failure.
    controller_changes: Vec<String>,
}

/// Every single failure of an actuator of the stock plant, from the start and from each of `at`; with `informed`, those
/// from the start once more with an informed controller. The first point is the healthy one.
///
/// # Errors
/// When the scenario has no stock plant.
pub fn single_failure_cases(
    scenario: &Scenario,
    file: &Path,
    at: &[Rational],
    informed: bool,
) -> Result<Cases, CasesError> {
    let refuse = |reason: &str| CasesError {
        path: file.to_owned(),
        line: None,
        reason: reason.to_owned(),
    };
    let plant = builtin(scenario, "plant")
        .ok_or_else(|| refuse("has no stock plant: list the cases in a file and give it with --cases"))?;
    let controller = builtin(scenario, "controller");
    if informed && controller.is_none() {
        return Err(refuse(
            "has no stock controller that could be informed: leave out --informed",
        ));
    }
    let failures = actuator_failures(scenario, plant, controller);
    let mut rows = vec![(
        ["none".to_owned(), String::new(), String::new(), "no".to_owned()],
        Vec::new(),
    )];
    let key = format!("participants.{plant}.parameters.faults");
    for from in std::iter::once(None).chain(at.iter().copied().map(Some)) {
        for failure in &failures {
            // before the first command, stuck is equivalent to off
            if from.is_none() && failure.actuator.starts_with("wheel") && failure.effect == "off" {
                continue;
            }
            let mut fault = Table::new();
            fault.insert("actuator".into(), failure.actuator.clone().into());
            fault.insert("effect".into(), failure.effect.into());
            if failure.effect == "weak" {
                fault.insert("factor".into(), 0.5.into());
            }
            if let Some(from) = from {
                fault.insert("from".into(), from.to_string().into());
            }
            let change = appended(scenario, &key, vec![Value::Table(fault)]).map_err(|reason| refuse(&reason))?;
            let effect = if failure.effect == "weak" {
                "half"
            } else {
                failure.effect
            };
            let row = |law_informed: &str| {
                let from = from.map_or("the start".to_owned(), |from| from.to_string());
                [
                    failure.actuator.clone(),
                    effect.to_owned(),
                    from,
                    law_informed.to_owned(),
                ]
            };
            rows.push((row("no"), vec![change.clone()]));
            if informed && from.is_none() && !failure.controller_changes.is_empty() {
                let mut changes = vec![change];
                changes.extend(failure.controller_changes.iter().cloned());
                rows.push((row("yes"), changes));
            }
        }
    }
    let names = ["actuator", "effect", "from", "law informed"];
    let texts = |at: usize| rows.iter().map(|(row, _)| row[at].clone()).collect();
    Ok(Cases {
        title: String::new(),
        columns: names
            .iter()
            .enumerate()
            .map(|(at, name)| Column::of_texts(name, texts(at)))
            .collect(),
        points: rows.into_iter().map(|(_, changes)| changes).collect(),
    })
}

fn actuator_failures(scenario: &Scenario, plant: &str, controller: Option<&str>) -> Vec<Failure> {
    let parameters = scenario.participants.iter().find(|entry| entry.setup.name == plant);
    let joints = parameters
        .and_then(|entry| {
            entry
                .setup
                .parameters
                .get("servicer")?
                .get("arm")?
                .get("joints")?
                .as_array()
        })
        .map(|names| names.iter().filter_map(Value::as_str).map(str::to_owned).collect());
    let joints: Vec<String> = joints.unwrap_or_else(|| (1..=7).map(|joint| format!("A{joint}")).collect());
    let mut all = Vec::new();
    let mut push = |actuator: String, effect, controller_changes| {
        all.push(Failure {
            actuator,
            effect,
            controller_changes,
        });
    };
    for (number, axis) in ["x", "y", "z"].into_iter().enumerate() {
        for (effect, remaining) in [("stuck", 0.0), ("off", 0.0), ("weak", 0.5)] {
            let controller_changes = controller.map_or(Vec::new(), |law| {
                thruster_couple_changes(scenario, plant, law, number, remaining)
            });
            push(format!("wheel.{axis}"), effect, controller_changes);
        }
    }
    let directions = ["+x", "-x", "+y", "-y", "+z", "-z"].map(str::to_owned);
    for thruster in (0..12).map(|number: u32| number.to_string()).chain(directions) {
        for effect in ["off", "on"] {
            push(format!("thruster.{thruster}"), effect, Vec::new());
        }
    }
    for (number, joint) in joints.iter().enumerate() {
        for effect in ["locked", "off"] {
            let controller_changes = controller.map_or(Vec::new(), |law| {
                let factors: Vec<String> = (0..joints.len())
                    .map(|other| if other == number { "0.0" } else { "1.0" }.to_owned())
                    .collect();
                vec![format!(
                    "participants.{law}.parameters.outer.weights.joint_factor=[{}]",
                    factors.join(", ")
                )]
            });
            push(format!("joint.{joint}"), effect, controller_changes);
        }
    }
    all
}

/// The changes that make thruster couples replace the torque that a wheel has lost; the fraction `remaining` of the torque
/// remains.
fn thruster_couple_changes(scenario: &Scenario, plant: &str, law: &str, axis: usize, remaining: f64) -> Vec<String> {
    let torques: Vec<String> = (0..3)
        .map(|other| if other == axis { 0.2 * remaining } else { 0.2 }.to_string())
        .collect();
    let mut changes = vec![format!(
        "participants.{law}.parameters.allocation.wheel_torque=[{}] N m",
        torques.join(", ")
    )];
    let connections = scenario.resolved().get("connections").and_then(Value::as_table);
    let mut connect = |from: String, to: String, more: &str| {
        let connected = connections.is_some_and(|all| {
            all.values()
                .any(|one| one.get("from").and_then(Value::as_str) == Some(&from))
        });
        if !connected {
            let name = from.replace('.', "-");
            changes.push(format!(
                "connections.{name}={{ from = \"{from}\", to = \"{to}\"{more} }}"
            ));
        }
    };
    connect(
        format!("{plant}.housekeeping"),
        format!("{law}.housekeeping"),
        ", initial = \"first-sample\"",
    );
    connect(format!("{law}.couples"), format!("{plant}.couples"), "");
    changes
}
