//! The messages between lander and autopilot. Frame N: origin on the ground, z up.

escapement::message! {
    /// The state of the lander.
    pub struct Motion {
        /// Height above the ground.
        pub height: f64 = "m" in "N",
        /// Velocity upwards.
        pub velocity: f64 = "m/s" in "N",
        /// Mass including the remaining propellant.
        pub mass: f64 = "kg",
        /// Speed at touchdown; zero before.
        pub touchdown_speed: f64 = "m/s",
    }
}

escapement::message! {
    /// The thrust command of the autopilot.
    pub struct Command {
        /// Thrust upwards.
        pub thrust: f64 = "N" in "N",
    }
}
