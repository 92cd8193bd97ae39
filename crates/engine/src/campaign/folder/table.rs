//! Table of a campaign: a row per point, with the varied values, the outcome, and every figure of merit.

use report::export::{Cells, Sheet, SheetColumn};

use crate::campaign::figures::{Figures, Number};
use crate::campaign::workers::point::Result as PointResult;
use crate::campaign::{Campaign, CampaignError};

/// The table of a campaign. Points that were not run have empty cells.
pub fn sheet(campaign: &Campaign, results: &[Option<PointResult>]) -> Sheet {
    let mut columns = vec![SheetColumn {
        name: "point".into(),
        unit: String::new(),
        cells: Cells::Whole((1..=results.len() as i64).collect()),
    }];
    for column in &campaign.columns {
        let cells = match (&column.whole, &column.numbers) {
            (Some(whole), _) => Cells::Whole(whole.clone()),
            // Whole numbers beyond 63 bits are written as given.
            (None, Some(numbers)) if !column.exceeds_i64() => {
                Cells::Number(numbers.iter().copied().map(Some).collect())
            }
            (None, _) => Cells::Text(column.texts.iter().cloned().map(Some).collect()),
        };
        columns.push(SheetColumn {
            name: column.name.clone(),
            unit: column.unit.clone(),
            cells,
        });
    }
    let text = |name: &str, of: &dyn Fn(&PointResult) -> Option<String>| SheetColumn {
        name: name.into(),
        unit: String::new(),
        cells: Cells::Text(results.iter().map(|result| result.as_ref().and_then(of)).collect()),
    };
    columns.push(text("outcome", &|result| Some(result.outcome.name().to_owned())));
    columns.push(text("reason", &|result| result.reason.clone()));
    // Every point of one scenario has the same figures.
    let figures = results.iter().flatten().find_map(|result| result.figures.as_ref());
    for Number { key, name, unit, .. } in figures.map_or(Vec::new(), Figures::ordered) {
        let cells = results
            .iter()
            .map(|result| result.as_ref()?.figures.as_ref()?.value(&key));
        columns.push(SheetColumn {
            name,
            unit,
            cells: Cells::Number(cells.collect()),
        });
    }
    if campaign.digests {
        columns.push(text("tape", &|result| result.tape.clone()));
    }
    // Only the file name: a table does not depend on the place of the scenario.
    let file = campaign.scenario.file_name().unwrap_or_default();
    Sheet {
        columns,
        about: vec![("escapement.scenario", file.to_string_lossy().into_owned())],
    }
}

/// The figure called `name`, with or without its unit.
///
/// # Errors
/// Names the existing figures.
pub fn figure_of(name: &str, known: &[Number]) -> Result<Number, CampaignError> {
    let plain = |name: &str| name.replace([' ', '-'], "_");
    let wanted = plain(name);
    let found = known
        .iter()
        .find(|known| plain(&known.key) == wanted || plain(&known.name) == wanted);
    found.cloned().ok_or_else(|| CampaignError::Figure {
        name: name.to_owned(),
        known: if known.is_empty() {
            "none: the scenario has no `measures` and no `assessment`, or no point has run".to_owned()
        } else {
            let names: Vec<&str> = known.iter().map(|known| known.name.as_str()).collect();
            names.join(", ")
        },
    })
}

/// The figure with this key of a point that ran to its end.
pub fn figure_value(result: &PointResult, key: &str) -> Option<f64> {
    result.final_figures()?.value(key)
}
