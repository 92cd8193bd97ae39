//! What a user of the navigation chooses.

use crate::target::TargetModel;

/// A pair of standard deviations or densities, for position and attitude.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PositionAttitude {
    /// Position part.
    pub position: f64,
    /// Attitude part.
    pub attitude: f64,
}

/// Everything a user chooses.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Parameters {
    /// The target's rigid-body motion.
    pub target: TargetModel,
    /// Standard deviation of the camera's slow errors, m and rad about each axis.
    pub drift_sigma: PositionAttitude,
    /// Time constant of the slow errors, s.
    pub drift_time_s: f64,
    /// Standard deviation of the camera's white errors, m and rad about each axis; above zero. Give more than the camera has to make the
    /// estimate smoother: against slow errors it costs hardly any accuracy, and a controller feels every step of the estimate.
    pub white_sigma: PositionAttitude,
    /// Density of the accelerations the model does not know, m/s² and rad/s² per √Hz. Keeps the filter awake.
    pub acceleration_density: PositionAttitude,
    /// Standard deviation of the velocities before the first pose, m/s and rad/s about each axis.
    pub initial_rate_sigma: PositionAttitude,
    /// A pose is refused when its normalised innovation squared exceeds this. 22.5 refuses one good pose in a thousand; infinity none.
    pub gate: f64,
    /// So many poses refused in a row start the filter anew: then it is the filter that is wrong.
    pub refusals_max: u32,
}
