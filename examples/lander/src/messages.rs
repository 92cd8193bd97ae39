//! What lander and autopilot tell each other. Frame N: origin on the ground, z up.

escapement::message! {
    /// Where the lander is.
    pub struct Motion {
        /// Height above the ground.
        pub height: f64 = "m" in "N",
        /// Velocity upwards.
        pub velocity: f64 = "m/s" in "N",
        /// Mass with the propellant that is left.
        pub mass: f64 = "kg",
        /// Speed at touchdown; zero before.
        pub touchdown_speed: f64 = "m/s",
    }
}

escapement::message! {
    /// What the autopilot asks of the engine.
    pub struct Command {
        /// Thrust upwards.
        pub thrust: f64 = "N" in "N",
    }
}
