//! Differential equations that a method integrates.

/// A first-order differential equation in coordinates, with a held input.
pub trait OdeSystem {
    /// A point of the state space.
    type State: Copy;
    /// Rates of the coordinates of a point.
    type Rate: Copy;
    /// The input, held over a step.
    type Force;

    /// Rates at `state` under `force`.
    fn rate(&self, state: &Self::State, force: &Self::Force) -> Self::Rate;

    /// `state + Σ kᵢ rateᵢ`, coordinate by coordinate.
    fn plus_rates(&self, state: &Self::State, by: &[(f64, &Self::Rate)]) -> Self::State;

    /// Projection back onto the constraints of the coordinates (unit quaternions, unit vectors) after a step.
    fn projected(&self, state: Self::State) -> Self::State {
        state
    }
}
