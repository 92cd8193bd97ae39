//! Page of a campaign: one self-contained HTML file in the style of a run's page.

use serde_json::Value;

use crate::page::{STYLE, TICKS, TOOLS, base64, filled};

const TEMPLATE: &str = include_str!("assets/campaign.html");
const STYLE_OF_ITS_OWN: &str = include_str!("assets/campaign.css");
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
    filled(
        TEMPLATE,
        title,
        &[STYLE, STYLE_OF_ITS_OWN],
        &data,
        &[TOOLS, TICKS, CASES, SCRIPT],
    )
}
