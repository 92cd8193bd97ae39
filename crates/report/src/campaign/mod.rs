//! Page of a campaign: one self-contained HTML file in the style of a run's page.

use serde_json::Value;

use crate::page::{STYLE, TICKS, TOOLS, base64, fill_template};

const TEMPLATE: &str = include_str!("assets/campaign.html");
const CAMPAIGN_STYLE: &str = include_str!("assets/campaign.css");
const CASES: &str = include_str!("assets/cases.js");
const SCRIPT: &str = include_str!("assets/campaign.js");

/// Numbers in the page's encoding: seven digits are finer than any picture. Missing values become NaN.
pub fn floats(values: Vec<f64>) -> Value {
    base64(values.into_iter().flat_map(|value| (value as f32).to_le_bytes())).into()
}

/// The page of a campaign called `title`, from the output of `engine::campaign::analysis`, or of its `of_cases` for a list
/// of cases.
pub fn page(title: &str, data: &Value) -> String {
    let data = data.to_string().replace('<', "\\u003c");
    fill_template(
        TEMPLATE,
        title,
        &[STYLE, CAMPAIGN_STYLE],
        &data,
        &[TOOLS, TICKS, CASES, SCRIPT],
    )
}
