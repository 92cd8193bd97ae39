//! Page of a list of cases. Cases are chosen, not drawn: they are compared one by one and are not a statistical sample.

use serde_json::{Value, json};

use super::{failures, figure};
use crate::campaign::Campaign;
use crate::campaign::success_name;
use crate::campaign::verdicts;
use crate::campaign::workers::point::{Result as PointResult, outcome_name};

/// The cases of a campaign with the outcome of each, for its page.
pub fn of_cases(title: &str, campaign: &Campaign, results: &[Option<PointResult>]) -> Value {
    let samples = figure::samples(results);
    let measures = samples.iter().filter(|sample| !sample.truth);
    let measures = measures.map(|sample| sample.plot_data(0..results.len()));
    let cases = results.iter().enumerate().map(|(at, result)| {
        let cells = campaign.columns.iter().map(|column| column.texts[at].as_str());
        json!({
            "cells": cells.collect::<Vec<_>>(),
            "outcome": outcome_name(result.as_ref()),
            "reason": result.as_ref().and_then(|result| result.reason.as_deref()),
        })
    });
    let ran = results.iter().flatten().filter(|result| result.outcome.ran()).count();
    let good = results.iter().flatten().filter(|result| result.outcome.good()).count();
    json!({
        "title": title,
        "words": verdicts(results),
        "good": success_name(results),
        "points": results.len(),
        "share": { "good": good, "ran": ran },
        "columns": campaign.columns.iter().map(|column| [column.name.as_str(), column.unit.as_str()]).collect::<Vec<_>>(),
        "inputs": [],
        "measures": measures.collect::<Vec<_>>(),
        "failures": failures::failure_groups(results),
        "cases": cases.collect::<Vec<_>>(),
    })
}
