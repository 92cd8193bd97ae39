//! User parameters of the navigation filter.

use crate::target::TargetModel;

/// A pair of standard deviations or densities, for position and attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionAttitude {
    /// Position part.
    pub position: f64,
    /// Attitude part.
    pub attitude: f64,
}

/// User parameters.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// The target's rigid-body motion.
    pub target: TargetModel,
    /// Standard deviation of the camera's slow errors, m and rad about each axis.
    pub drift_sigma: PositionAttitude,
    /// Time constant of the slow errors, s.
    pub drift_time_s: f64,
    /// Standard deviation of the camera's white errors, m and rad about each axis; above zero. A value above the camera's true one makes
    /// the estimate smoother: next to the slow errors it costs hardly any accuracy, and every step of the estimate reaches the controller.
    pub white_sigma: PositionAttitude,
    /// Density of the unmodelled accelerations, m/s² and rad/s² per √Hz. Keeps the filter gain from vanishing.
    pub acceleration_density: PositionAttitude,
    /// Standard deviation of the velocities before the first pose, m/s and rad/s about each axis.
    pub initial_rate_sigma: PositionAttitude,
    /// A pose is rejected when its normalised innovation squared exceeds this. 22.5 rejects one good pose in a thousand; infinity none.
    pub gate: f64,
    /// Number of consecutive rejected poses after which the filter is re-initialised: then the estimate is assumed wrong.
    pub rejections_max: u32,
}
