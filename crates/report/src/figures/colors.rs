//! The colours of figures, and their meaning.

/// A colour: red, green, blue.
pub type Rgb = [u8; 3];

pub(super) const INK: Rgb = [23, 32, 43];
pub(super) const SOFT: Rgb = [91, 103, 117];
pub(super) const GRID: Rgb = [226, 230, 235];
pub(super) const LIMIT: Rgb = [194, 47, 47];
/// Distinguishable also for most colour-blind readers, in print and on screen.
pub(super) const COLORS: [Rgb; 8] = [
    [11, 102, 179],
    [212, 84, 26],
    [20, 135, 90],
    [168, 73, 156],
    [184, 135, 0],
    [47, 163, 199],
    [106, 90, 205],
    [122, 106, 92],
];

/// All criteria met.
pub(super) const GOOD: Rgb = [223, 240, 224];
/// Where something did not run at all.
pub(super) const BROKEN: Rgb = [226, 226, 230];
/// A cell of a map with a criterion not met.
const BAD: Rgb = [244, 201, 176];

/// The outcome of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Shade {
    /// All criteria are met; how near to the worst of the points that are met, from 0 to 1.
    Good(f32),
    /// A criterion is not met.
    Bad,
    /// It did not run.
    Broken,
    /// Not yet known.
    Unknown,
}

pub(super) fn color(shade: Shade) -> Rgb {
    match shade {
        Shade::Good(part) => {
            // from a pale green to a deep one
            let (pale, deep) = ([226.0, 243.0, 226.0], [86.0, 168.0, 112.0]);
            let part = if part.is_finite() { part.clamp(0.0, 1.0) } else { 0.0 };
            std::array::from_fn(|k| (pale[k] + (deep[k] - pale[k]) * part).round() as u8)
        }
        Shade::Bad => BAD,
        Shade::Broken => BROKEN,
        Shade::Unknown => [255, 255, 255],
    }
}
