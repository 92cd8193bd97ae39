//! The navigation filter with what it needs to be restored.

use guidance_laws::navigation::NavigationFilter;

/// The filter with what it needs to be restored.
#[derive(Debug)]
pub struct Navigation {
    /// The filter.
    pub filter: NavigationFilter,
    /// What it was made from.
    pub parameters: guidance_laws::navigation::Parameters,
    /// Pictures refused so far.
    pub refused: u64,
    /// Normalised innovation squared of the last picture.
    pub innovation: f64,
}
