//! Sensor messages of the servicer.

lockstep::message! {
    /// State of the servicer measured by its own sensors: base and arm, without the propellant.
    #[allow(non_snake_case)]
    pub struct Measured {
        /// Position of the base.
        pub p_NB_N: [f64; 3] = "m" in "N",
        /// Attitude of the base, scalar first; zeros: nothing measured yet.
        pub quat_NB: [f64; 4] = "1",
        /// Joint angles A1 to A7.
        pub q: [f64; 7] = "rad",
        /// Angular velocity of the base.
        pub omega_NB_B: [f64; 3] = "rad/s" in "B",
        /// Velocity of the base's origin.
        pub v_NB_B: [f64; 3] = "m/s" in "B",
        /// Joint rates.
        pub qdot: [f64; 7] = "rad/s",
    }
}

lockstep::message! {
    /// Motion of the target's body frame, origin at its centre of mass.
    #[allow(non_snake_case)]
    pub struct TargetState {
        /// Time of validity of the other fields.
        pub stamp: f64 = "s",
        /// Position of the centre of mass.
        pub p_NT_N: [f64; 3] = "m" in "N",
        /// Attitude, scalar first; zeros: nothing seen yet.
        pub quat_NT: [f64; 4] = "1",
        /// Velocity of the centre of mass.
        pub v_NT_N: [f64; 3] = "m/s" in "N",
        /// Angular velocity.
        pub omega_NT_T: [f64; 3] = "rad/s" in "T",
    }
}

lockstep::message! {
    /// Pose of the target measured by the camera: sampled periodically, and held until the next sample.
    #[allow(non_snake_case)]
    pub struct CameraPose {
        /// Time at which the image was taken.
        pub stamp: f64 = "s",
        /// Measured position of the target's body frame.
        pub p_NT_N: [f64; 3] = "m" in "N",
        /// Measured attitude, scalar first; zeros: no image yet.
        pub quat_NT: [f64; 4] = "1",
    }
}

lockstep::message! {
    /// Housekeeping data of the servicer's units.
    #[allow(non_snake_case)]
    pub struct Housekeeping {
        /// Angular momentum stored in the reaction wheels.
        pub wheel_momentum_B: [f64; 3] = "N m s" in "B",
        /// Pose of the target's body frame in the end effector's, as held by the gripper: position. Zero before the grasp.
        pub p_ET_E: [f64; 3] = "m" in "E",
        /// The same pose: attitude, scalar first. Zeros before the grasp.
        pub quat_ET: [f64; 4] = "1",
        /// Whether the gripper has closed on the target.
        pub grasped: bool = "1",
        /// Padding.
        pub padding: [u8; 7] = "1",
    }
}
