//! Default experiments that no run can have.

use super::content::Experiment;

/// Leaves out the times of a default experiment that mean nothing; returns what is wrong with each.
pub(super) fn discard_invalid_times(experiment: &mut Experiment) -> Vec<String> {
    let mut found = Vec::new();
    let Experiment { start, stop, step, .. } = experiment;
    let first = start.unwrap_or(0.0);
    if let Some(wrong) = stop.take_if(|stop| *stop <= first) {
        found.push(format!(
            "`stopTime` is {wrong} s, which is not after the start at {first} s, and is not used"
        ));
    }
    if let Some(wrong) = step.take_if(|step| *step <= 0.0) {
        found.push(format!(
            "`stepSize` is {wrong} s, which is not positive, and is not used"
        ));
    }
    found
}
