//! Figures and scene of a capture for the report: fields shown, actuator limits, momentum of each body.

mod momenta;
mod parameters;
mod scene;
mod table;
mod target;

use std::collections::BTreeMap;
use std::sync::Arc;

use lockstep::time::Rational;
use lockstep::units::convert;
use report::view::{Computed, Figure, Formula, Signal, View};
use tape::StreamSpec;
use toml::{Table, Value};

use momenta::Momenta;
use parameters::parameters;
use table::{FIGURES, FigureSpec, MomentumQuantity};

/// The keys of a capture's summary that are shown first.
const HEADLINE: [&str; 9] = [
    "captured",
    "measures.position_error_at_grasp",
    "measures.attitude_error_at_grasp",
    "measures.relative_speed_at_grasp",
    "peak_base_torque_n_m",
    "peak_base_force_n",
    "peak_joint_torque_n_m",
    "saturated_fraction",
    "slosh_max_deg",
];

/// The view of a run: the figures whose ports and fields it has, from any participant, and the instants of the schedule.
pub fn view(streams: &[StreamSpec], plan: &Table) -> View {
    let limits = actuator_limits(plan);
    let momenta = streams
        .iter()
        .find_map(|spec| Some((spec, Arc::new(Momenta::of(spec, plan)?))));
    let figures = FIGURES.iter().map(|row| figure(row, &limits, momenta.as_ref()));
    let (scene, notes) = scene::scene(streams, plan);
    View {
        figures: figures.collect(),
        marks: schedule(plan),
        headline: HEADLINE.map(String::from).into(),
        scene,
        notes,
    }
}

fn figure(
    row: &FigureSpec,
    limits: &BTreeMap<&str, Vec<f64>>,
    momenta: Option<&(&StreamSpec, Arc<Momenta>)>,
) -> Figure {
    let mut figure = Figure::new(row.group, row.id, row.title, (row.unit, row.scale));
    for curve in row.curves {
        let at = |names: table::Names| Signal::at(curve.port, names);
        let formula = match curve.formula {
            table::Formula::Each(a) => Formula::Each(at(a)),
            table::Formula::Part(a, from, to) => Formula::Each(at(a).part(from, to)),
            table::Formula::Norm(a) => Formula::Norm(at(a)),
            table::Formula::Distance(a, b) => Formula::Distance(at(a), at(b)),
            table::Formula::Angle(a, b) => Formula::Angle(at(a), at(b)),
            table::Formula::PositionIn(p, origin, axes) => Formula::PositionIn(at(p), at(origin), at(axes)),
            table::Formula::AttitudeIn(attitude, axes) => Formula::AttitudeIn(at(attitude), at(axes)),
            table::Formula::RotationVector(a) => Formula::RotationVector(at(a)),
            table::Formula::Bodies(quantity) => match momenta {
                Some((spec, momenta)) => Formula::Computed(Arc::new(MomentumCurves {
                    participant: spec.participant.clone(),
                    port: spec.port.clone(),
                    momenta: momenta.clone(),
                    quantity,
                })),
                None => continue,
            },
        };
        figure = figure.curve(formula, curve.labels);
    }
    match row.limits.and_then(|key| limits.get(key)) {
        Some(values) => figure.between(values),
        None => figure,
    }
}

/// One figure of the momenta of a stream.
struct MomentumCurves {
    participant: String,
    port: String,
    momenta: Arc<Momenta>,
    quantity: MomentumQuantity,
}

impl Computed for MomentumCurves {
    fn stream(&self) -> (&str, &str) {
        (&self.participant, &self.port)
    }

    fn labels(&self) -> Vec<String> {
        self.momenta.labels(self.quantity)
    }

    fn origin(&self) -> String {
        format!("{}.{}, computed from the motion", self.participant, self.port)
    }

    fn values(&self, payload: &[u8], out: &mut [f64]) {
        self.momenta.values(self.quantity, payload, out);
    }
}

/// The instants of the guidance schedule.
fn schedule(plan: &Table) -> Vec<(String, Rational)> {
    let tables = parameters(plan).filter_map(|parameters| parameters.get("schedule")?.as_table());
    let instants = tables
        .flatten()
        .filter_map(|(name, at)| Some((name.clone(), at.as_str()?.parse().ok()?)));
    instants.collect()
}

/// The limits of the actuators, from the tables `actuators` of the participants in the plan, else from `assessment.limits`.
/// The plan is the user's scenario with its defaults, so quantities are texts with units; a plan of another program has
/// other tables, and no limits are drawn then.
fn actuator_limits(plan: &Table) -> BTreeMap<&'static str, Vec<f64>> {
    let mut limits = BTreeMap::new();
    let lookup = |table: &Table, path: &[&str], unit: &str| {
        let (last, folders) = path.split_last()?;
        let inner = folders
            .iter()
            .try_fold(table, |table, key| table.get(*key)?.as_table())?;
        let numbers = numbers_in(inner.get(*last)?, unit);
        (!numbers.is_empty()).then_some(numbers)
    };
    for table in parameters(plan).filter_map(|parameters| parameters.get("actuators")?.as_table()) {
        for (key, path, unit) in [
            ("base_torque", ["wheels", "torque"], "N m"),
            ("wheel_momentum", ["wheels", "momentum"], "N m s"),
            ("base_force", ["thrusters", "force"], "N"),
            ("joint_torque", ["joints", "torque"], "N m"),
        ] {
            if let Some(numbers) = lookup(table, &path, unit) {
                limits.insert(key, numbers);
            }
        }
    }
    for (key, name, unit) in [
        ("base_torque", "torque", "N m"),
        ("base_force", "force", "N"),
        ("joint_torque", "joint_torque", "N m"),
    ] {
        let given = lookup(plan, &["assessment", "limits", name], unit);
        if let (false, Some(numbers)) = (limits.contains_key(key), given) {
            limits.insert(key, numbers);
        }
    }
    limits
}

/// The numbers of `"0.2 N m"`, `"[320, 40] N m"` or `9.0` in `unit`; none for what is no quantity of its dimension.
fn numbers_in(value: &Value, unit: &str) -> Vec<f64> {
    match value {
        Value::Float(x) => vec![*x],
        Value::Integer(x) => vec![*x as f64],
        Value::Array(items) => items.iter().flat_map(|item| numbers_in(item, unit)).collect(),
        Value::String(text) => convert(text, unit).map_or(Vec::new(), |(numbers, _)| numbers),
        _ => Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_come_from_the_plan() {
        let plan = r#"
            [participants.plant.parameters.actuators]
            wheels = { torque = "200 mN m", momentum = "12 kg m^2/s" }
            thrusters = { force = "9 of them" }
            joints = { torque = "[320, 40.5] N m" }
            [participants.guidance.parameters]
            schedule = { start = "1 s", point = "20 s" }
            [assessment.limits]
            force = "[9, 9, 8] N"
            torque = "1 N m"
        "#;
        let plan: Table = plan.parse().unwrap();
        let limits = actuator_limits(&plan);
        assert_eq!(limits["base_torque"], [0.2]);
        assert_eq!(limits["wheel_momentum"], [12.0]);
        assert_eq!(limits["joint_torque"], [320.0, 40.5]);
        assert_eq!(limits["base_force"], [9.0, 9.0, 8.0]);
        let marks = schedule(&plan);
        assert_eq!(marks[0], ("point".to_owned(), Rational::from_millis(20_000)));
        assert_eq!(marks.len(), 2);
    }
}
