//! Points that failed, grouped by reason.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::campaign::workers::point::{Outcome, Result as PointResult};

/// Groups of points that failed, the largest first: outcome, an example of the reason, number of points, and the first of
/// them. Reasons that differ only in numbers are one group.
pub(super) fn failure_groups(results: &[Option<PointResult>]) -> Vec<Value> {
    let mut groups: BTreeMap<(&'static str, String), (String, Vec<usize>)> = BTreeMap::new();
    for (at, result) in results.iter().enumerate() {
        let Some(result) = result.as_ref().filter(|result| !result.outcome.good()) else {
            continue;
        };
        let reason = result.reason.clone().unwrap_or_default();
        // Digits in the names of criteria may be significant.
        let key = if result.outcome == Outcome::NotMet {
            reason.clone()
        } else {
            without_numbers(&reason)
        };
        let group = groups.entry((result.outcome.name(), key));
        group.or_insert_with(|| (reason, Vec::new())).1.push(at + 1);
    }
    let mut all: Vec<_> = groups.into_iter().collect();
    all.sort_by_key(|(_, (_, points))| std::cmp::Reverse(points.len()));
    let rows = all.into_iter().map(|((outcome, _), (reason, points))| {
        json!({
            "outcome": outcome,
            "reason": reason,
            "count": points.len(),
            "points": points.into_iter().take(10).collect::<Vec<_>>(),
        })
    });
    rows.collect()
}

/// The text with every number replaced by `#`.
fn without_numbers(text: &str) -> String {
    let mut out = String::new();
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        if !letter.is_ascii_digit() {
            out.push(letter);
            continue;
        }
        out.push('#');
        while letters
            .peek()
            .is_some_and(|next| next.is_ascii_digit() || matches!(next, '.' | 'e' | '-'))
        {
            letters.next();
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failure_groups_ignore_numbers_in_reasons() {
        let failed = |reason: &str| Some(PointResult::without(Outcome::Failed, reason));
        let results = [
            failed("`x` failed at t = 1.25 s: q is 3e-5"),
            Some(PointResult::without(Outcome::NotMet, "settled")),
            failed("`x` failed at t = 12 s: q is 7"),
            None,
            Some(PointResult::without(Outcome::Met, "")),
        ];
        let groups = failure_groups(&results);
        assert_eq!(groups.len(), 2);
        assert_eq!(groups[0]["count"], 2);
        assert_eq!(groups[0]["points"], json!([1, 3]));
        assert_eq!(groups[1]["reason"], "settled");
    }
}
