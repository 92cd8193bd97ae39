//! Picture of a campaign: where the criteria are met.

use report::figures::Drawing;

use super::content::Picture;
use super::over_one::over_one;
use super::over_two::over_two;
use super::spread;
use crate::campaign::Column;
use crate::campaign::tell::distinct;

/// Maximum number of positions along one side of a picture; with more no picture is drawn.
const PLACES_MAX: usize = 2000;

/// The picture: a chart over one varied key, a map over two. Further varied keys, and the seed beside another key, are
/// folded: a position is met when all of its points are met, and shows the worst. Where hardly two points share a value, as
/// with drawn values, and where a key has more than 2000 values, the picture shows the distances from the limits instead.
/// `None` when nothing is varied.
pub fn draw(picture: &Picture<'_>) -> Option<Drawing> {
    let varied: Vec<&Column> = picture
        .columns
        .iter()
        .filter(|column| distinct(&column.texts).len() > 1)
        .collect();
    let own = |column: &&&Column| column.name != "seed";
    let mut shown: Vec<&Column> = varied.iter().filter(own).take(2).copied().collect();
    if shown.is_empty() {
        shown.extend(varied.first());
    }
    let places: Vec<usize> = shown.iter().map(|column| distinct(&column.texts).len()).collect();
    // Drawn values hardly ever repeat, and make no map.
    let apart = places.len() == 2 && places[0] * places[1] > 4 * picture.results.len();
    match shown[..] {
        [_, ..] if apart || places.iter().any(|count| *count > PLACES_MAX) => spread::draw(picture),
        [x] => Some(over_one(picture, x)),
        [x, y] => Some(over_two(picture, x, y)),
        _ => None,
    }
}
