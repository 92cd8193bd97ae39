//! Selection of the points whose run folders are kept.

use std::collections::BTreeSet;
use std::str::FromStr;

use crate::campaign::figures::{Figures, LimitUsage, Number};
use crate::campaign::workers::point::{Outcome, Result as PointResult};

/// A selection of the points of a campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Keep {
    /// All points.
    All,
    /// Points whose runs did not reach their ends.
    Failed,
    /// Those points, and points that do not meet every criterion.
    NotMet,
    /// This number of points that ran: the worst ones.
    Worst(usize),
}

impl FromStr for Keep {
    type Err = String;

    fn from_str(text: &str) -> Result<Keep, String> {
        let worst = |text: &str| text.strip_prefix("worst:")?.parse().ok().filter(|count| *count > 0);
        match (text, worst(text)) {
            ("all", _) => Ok(Keep::All),
            ("failed", _) => Ok(Keep::Failed),
            ("not-met", _) => Ok(Keep::NotMet),
            (_, Some(count)) => Ok(Keep::Worst(count)),
            _ => Err(format!(
                "`{text}` names no points: write all, failed, not-met or worst:10"
            )),
        }
    }
}

/// The points (from 0) that `keep` selects. The worst are those with the greatest `figure`, or the least where it has a
/// lower limit only; without `figure`, those closest to a limit or furthest beyond it.
pub(crate) fn selected_points(
    keep: &[Keep],
    results: &[Option<PointResult>],
    figure: Option<&Number>,
) -> BTreeSet<usize> {
    let mut points = BTreeSet::new();
    for keep in keep {
        let all = results.iter().enumerate();
        let all = all.filter_map(|(at, result)| Some((at, result.as_ref()?)));
        let some = |wanted: fn(Outcome) -> bool| all.clone().filter(move |(_, result)| wanted(result.outcome));
        // A point that was refused has no run folder.
        match keep {
            Keep::All => points.extend(some(|outcome| outcome != Outcome::Refused).map(|(at, _)| at)),
            Keep::Failed => points.extend(some(is_failed).map(|(at, _)| at)),
            Keep::NotMet => {
                points.extend(some(|outcome| is_failed(outcome) || outcome == Outcome::NotMet).map(|(at, _)| at));
            }
            Keep::Worst(count) => {
                let ran = some(Outcome::ran)
                    .filter_map(|(at, result)| Some((severity(result.figures.as_ref()?, figure)?, at)));
                let mut ran: Vec<(LimitUsage, usize)> = ran.collect();
                ran.sort_by(|a, b| b.0.cmp_severity(&a.0).then(a.1.cmp(&b.1)));
                points.extend(ran.iter().take(*count).map(|(_, at)| *at));
            }
        }
    }
    points
}

fn is_failed(outcome: Outcome) -> bool {
    matches!(outcome, Outcome::Failed | Outcome::Crashed)
}

/// The severity of a point's result: larger is worse, and a figure that was not measured is worst. `None` where nothing can be
/// compared.
fn severity(figures: &Figures, figure: Option<&Number>) -> Option<LimitUsage> {
    let value = |number: &Number| LimitUsage::of_value(figures.value(&number.key));
    let Some(figure) = figure else {
        let judged = figures.most_critical().map(|(usage, _)| usage);
        return judged.or_else(|| figures.numbers().next().as_ref().map(value));
    };
    let own = figures.criteria.iter().find(|criterion| criterion.name == figure.name);
    let lower_is_worse = own.is_some_and(|criterion| criterion.limit.is_none() && criterion.at_least.is_some());
    let value = figures.value(&figure.key);
    Some(LimitUsage::of_value(if lower_is_worse {
        value.map(|value| -value)
    } else {
        value
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::assessment::Criterion;

    fn point(outcome: Outcome, value: Option<f64>, limit: Option<f64>, at_least: Option<f64>) -> Option<PointResult> {
        let criterion = Criterion {
            name: "miss".into(),
            value,
            limit,
            at_least,
            ..Criterion::default()
        };
        let number = Number {
            key: "miss".into(),
            name: "miss".into(),
            unit: String::new(),
            value,
        };
        Some(PointResult {
            figures: Some(Figures::new(
                vec![number],
                if limit.or(at_least).is_some() {
                    vec![criterion]
                } else {
                    Vec::new()
                },
            )),
            ..PointResult::without(outcome, "")
        })
    }

    fn of(keep: &str, results: &[Option<PointResult>]) -> Vec<usize> {
        selected_points(&[keep.parse().unwrap()], results, None)
            .into_iter()
            .collect()
    }

    #[test]
    fn keep_worst_selects_points_closest_to_limits() {
        let most = |value| point(Outcome::Met, value, Some(2.0), None);
        let results = [most(Some(1.0)), most(Some(3.0)), None, most(Some(1.5)), most(Some(1.5))];
        assert_eq!(of("worst:1", &results), [1]);
        assert_eq!(of("worst:2", &results), [1, 3], "of two alike the first");
        let least = |value| point(Outcome::Met, value, None, Some(2.0));
        assert_eq!(
            of("worst:1", &[least(Some(5.0)), least(Some(2.5)), least(Some(9.0))]),
            [1]
        );
        assert_eq!(
            of("worst:1", &[most(Some(9.0)), most(None)]),
            [1],
            "not measured is worst"
        );
        let values = [0.05, -0.05, 0.001, -0.01].map(|value| least(Some(value)));
        assert_eq!(
            of("worst:1", &values),
            [1],
            "the furthest below, where there is no fraction"
        );
        assert_eq!(of("worst:2", &values), [1, 3]);
        let zero = [-2.0, 3.0, 1.0, -1.0].map(|value| point(Outcome::Met, Some(value), Some(0.0), None));
        assert_eq!(of("worst:3", &zero), [1, 2, 3], "a limit of zero");
        let free = |value| point(Outcome::Complete, value, None, None);
        assert_eq!(
            of("worst:1", &[free(Some(-3.0)), free(Some(1.0))]),
            [1],
            "without a limit the greatest"
        );
    }

    #[test]
    fn keep_failed_selects_points_that_did_not_end() {
        let outcomes = [
            Outcome::Met,
            Outcome::NotMet,
            Outcome::Refused,
            Outcome::Failed,
            Outcome::Crashed,
        ];
        let results = outcomes.map(|outcome| point(outcome, Some(1.0), Some(1.0), None));
        assert_eq!(of("failed", &results), [3, 4]);
        assert_eq!(of("not-met", &results), [1, 3, 4]);
        assert_eq!(of("all", &results), [0, 1, 3, 4]);
    }

    #[test]
    fn keep_selection_rejects_unknown_text() {
        for text in ["worst", "worst:0", "worst:x", "best:3", ""] {
            let error = text.parse::<Keep>().unwrap_err();
            assert!(error.contains("worst:10"), "{error}");
        }
    }
}
