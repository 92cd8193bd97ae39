//! The messages of the three participants.

lockstep::message! {
    /// The state of the mass.
    pub struct Motion {
        /// Displacement from the unstretched spring, along x.
        pub position: f64 = "m" in "N",
        /// Velocity along x.
        pub velocity: f64 = "m/s" in "N",
    }
}

lockstep::message! {
    /// The force on the mass.
    pub struct Push {
        /// Force along x.
        pub force: f64 = "N" in "N",
    }
}

lockstep::message! {
    /// The reference position of the mass.
    pub struct Target {
        /// Displacement from the unstretched spring, along x.
        pub position: f64 = "m" in "N",
    }
}
