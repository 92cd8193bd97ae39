//! What the three tell each other.

lockstep::message! {
    /// Where the mass is and how fast it moves.
    pub struct Motion {
        /// Distance from where the spring is slack, along x.
        pub position: f64 = "m" in "N",
        /// Velocity along x.
        pub velocity: f64 = "m/s" in "N",
    }
}

lockstep::message! {
    /// What pushes the mass.
    pub struct Push {
        /// Force along x.
        pub force: f64 = "N" in "N",
    }
}

lockstep::message! {
    /// Where the mass shall be.
    pub struct Target {
        /// Distance from where the spring is slack, along x.
        pub position: f64 = "m" in "N",
    }
}
