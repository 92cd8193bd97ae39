//! Figures of how a run followed the wall clock.

use std::collections::BTreeMap;

use serde::Serialize;

/// The pace counts as met if at least this fraction of the requested one was achieved.
const MET_FRACTION: f64 = 0.99;

/// How a run followed the wall clock. These figures depend on the machine; none of them is on the tape.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PaceReport {
    /// The requested real-time factor: simulated seconds per second of wall time.
    pub requested: f64,
    /// The real-time factor up to the end of the last step, without the time spent paused; `None` where no step reports its
    /// end.
    pub achieved: Option<f64>,
    /// Whether at least 99 % of the requested factor was achieved.
    pub met: bool,
    /// Of each participant.
    pub participants: BTreeMap<String, Lateness>,
}

/// How late the steps of a participant were completed, measured from the instant at which the wall clock reached their time.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Lateness {
    /// The steps that were evaluated; none for a program that does not report when a step is done.
    pub steps: u64,
    /// Steps that were completed only after the participant's next step was due.
    pub overruns: u64,
    /// Steps whose own work, without waiting, took longer than one period of the participant.
    pub too_long: u64,
    /// Half of the steps were no later, s.
    pub lateness_p50_s: f64,
    /// 99 of 100 steps were no later, s.
    pub lateness_p99_s: f64,
    /// 999 of 1000 steps were no later, s.
    pub lateness_p999_s: f64,
    /// The lateness of the latest step, s.
    pub lateness_largest_s: f64,
    /// The simulated time of that step, s.
    pub largest_at_s: f64,
}

impl PaceReport {
    /// Whether the pace is met with these factors. A run that ends with its first step cannot be behind.
    pub(crate) fn is_met(requested: f64, achieved: Option<f64>) -> bool {
        achieved.is_none_or(|achieved| achieved >= MET_FRACTION * requested)
    }

    /// The message that the pace was not met, with the participants that were late; `None` if it was met.
    pub fn warning(&self) -> Option<String> {
        if self.met {
            return None;
        }
        let late = |all: &mut dyn Iterator<Item = (&String, u64, u64)>, what: &str| {
            let mut all: Vec<_> = all.filter(|(_, count, _)| *count > 0).collect();
            all.sort_by_key(|(name, count, steps)| {
                (
                    std::cmp::Reverse(u128::from(*count) * 1_000_000 / u128::from(*steps)),
                    *name,
                )
            });
            let words: Vec<String> = (all.iter())
                .map(|(name, count, steps)| format!("`{name}` ({count} of {steps} steps {what})"))
                .collect();
            (!words.is_empty()).then(|| words.join(", "))
        };
        let participants = self.participants.iter();
        let slow = late(
            &mut participants.clone().map(|(name, one)| (name, one.too_long, one.steps)),
            "worked for longer than their period",
        );
        let waited = || {
            late(
                &mut participants.clone().map(|(name, one)| (name, one.overruns, one.steps)),
                "overran",
            )
        };
        let cause = slow.or_else(waited);
        let cause = cause.map_or_else(
            || "no participant reports when its steps are complete".to_owned(),
            |cause| format!("late: {cause}"),
        );
        let achieved = self.achieved.map_or_else(|| "less".to_owned(), factor);
        Some(format!(
            "the pace was not met: {achieved} times real time, and {} was requested; {cause}",
            factor(self.requested)
        ))
    }
}

/// A real-time factor for people, with three significant digits.
pub fn factor(factor: f64) -> String {
    if factor >= 99.95 || factor == 0.0 {
        return format!("{factor:.0}");
    }
    let digits = (2 - factor.log10().floor() as i32).clamp(0, 9) as usize;
    let text = format!("{factor:.digits$}");
    if text.contains('.') {
        text.trim_end_matches('0').trim_end_matches('.').to_owned()
    } else {
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn factor_is_formatted_with_three_digits() {
        let formatted = [0.0, 0.00123, 0.0431, 0.5, 0.9998, 1.0, 12.34, 122.4].map(factor);
        assert_eq!(formatted, ["0", "0.00123", "0.0431", "0.5", "1", "1", "12.3", "122"]);
    }
}
