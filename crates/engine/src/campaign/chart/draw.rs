//! Chart of a campaign: where the criteria are met.

use report::figures::Drawing;

use super::content::ChartContent;
use super::distribution;
use super::one_key::chart_over_one_key;
use super::two_keys::map_over_two_keys;
use crate::campaign::Column;
use crate::campaign::summary::distinct;

/// Maximum number of positions along one side of a chart; with more no chart is drawn.
const POSITIONS_MAX: usize = 2000;

/// Draws the chart: curves over one varied key, a map over two. Further varied keys, and the seed beside another key, are
/// folded: a position is met when all of its points are met, and shows the worst. Where hardly two points share a value, as
/// with drawn values, and where a key has more than 2000 values, the chart shows the distances from the limits instead.
/// `None` when nothing is varied.
pub fn draw_chart(chart: &ChartContent<'_>) -> Option<Drawing> {
    let varied: Vec<&Column> = chart
        .columns
        .iter()
        .filter(|column| distinct(&column.texts).len() > 1)
        .collect();
    let own = |column: &&&Column| column.name != "seed";
    let mut shown: Vec<&Column> = varied.iter().filter(own).take(2).copied().collect();
    if shown.is_empty() {
        shown.extend(varied.first());
    }
    let positions: Vec<usize> = shown.iter().map(|column| distinct(&column.texts).len()).collect();
    // Random samples hardly ever repeat, so that there is no grid for a map.
    let is_scattered = positions.len() == 2 && positions[0] * positions[1] > 4 * chart.results.len();
    match shown[..] {
        [_, ..] if is_scattered || positions.iter().any(|count| *count > POSITIONS_MAX) => {
            distribution::draw_distribution(chart)
        }
        [x] => Some(chart_over_one_key(chart, x)),
        [x, y] => Some(map_over_two_keys(chart, x, y)),
        _ => None,
    }
}
