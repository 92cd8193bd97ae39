//! The picture of a campaign: where the criteria are met.

use report::figures::Drawing;

use super::over_one::over_one;
use super::over_two::over_two;
use super::picture::Picture;
use super::tell::distinct;
use super::{Column, spread};

/// With more places along one of its sides a picture shows none of them.
const PLACES_MAX: usize = 2000;

/// The picture: a chart over one varied key, a map over two. What else is varied, and the seed beside another key, is folded:
/// a place is met when all of its points are, and shows the worst. Where hardly two points have a value in common, as those that were
/// drawn, and where a key has more than 2000 values, it is how far they stay from their limits. `None` when nothing is varied.
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
    // Values that were drawn lie nowhere twice, and make no map.
    let apart = places.len() == 2 && places[0] * places[1] > 4 * picture.results.len();
    match shown[..] {
        [_, ..] if apart || places.iter().any(|count| *count > PLACES_MAX) => spread::draw(picture),
        [x] => Some(over_one(picture, x)),
        [x, y] => Some(over_two(picture, x, y)),
        _ => None,
    }
}
