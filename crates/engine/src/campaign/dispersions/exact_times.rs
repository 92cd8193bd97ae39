//! Keys whose values are exact fractions of seconds: a drawn number has too many digits for them, unless it is rounded.

use lockstep::time::Rational;

use super::{Dispersion, ValueSource};
use crate::scenario::Scenario;

/// The digits of a time that no exact fraction has: its denominator in lowest terms needs more than 63 bits.
const UNROUNDED: &str = "0.1234567890123456789";

/// The dispersions whose draws would be written to a key with exact times without being rounded, each with the first such key and
/// the unit there. Whether one of these draws happens to have few digits is an accident.
pub fn unrounded_instants(dispersions: &[Dispersion], scenario: &Scenario) -> Vec<[String; 3]> {
    let computed = |one: &&Dispersion| matches!(one.source, ValueSource::Scalar(_) | ValueSource::Formula(..));
    let unrounded = dispersions.iter().filter(|one| one.step.is_none()).filter(computed);
    let found = unrounded.filter_map(|one| {
        let mut keys = one.targets.iter().filter(|target| target.element.is_none());
        let exact = keys.find(|target| is_exact_time(scenario, &target.key, &one.value_unit))?;
        Some([one.name.clone(), exact.key.clone(), one.value_unit.clone()])
    });
    found.collect()
}

/// Whether `key` takes an exact time in this unit: a number with too many digits is refused for that reason alone.
fn is_exact_time(scenario: &Scenario, key: &str, unit: &str) -> bool {
    let text = format!("{UNROUNDED} {unit}");
    let Err(error) = text.parse::<Rational>() else {
        return false;
    };
    let refused = scenario.spec().clone().vary(&[format!("{key}={text}")]);
    refused.is_err_and(|refusal| refusal.to_string().contains(&error.to_string()))
}
