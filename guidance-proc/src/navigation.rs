//! The navigation filter with the data needed to restore it.

use guidance_laws::navigation::NavigationFilter;

/// The filter with the data needed to restore it.
#[derive(Debug)]
pub struct Navigation {
    /// The filter.
    pub filter: NavigationFilter,
    /// Parameters from which the filter was built.
    pub parameters: guidance_laws::navigation::Parameters,
    /// Camera poses rejected so far.
    pub rejected: u64,
    /// Normalised innovation squared of the last camera pose.
    pub innovation: f64,
}
