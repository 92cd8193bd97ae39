//! True state of the plant, for the recorder and the figures. A controller never reads it.

lockstep::message! {
    /// Complete true state of the plant. Applied forces are those of the step that ended at the stamp.
    #[allow(non_snake_case)]
    pub struct Truth {
        /// Position of the base.
        pub p_NB_N: [f64; 3] = "m" in "N",
        /// Attitude of the base, scalar first.
        pub quat_NB: [f64; 4] = "1",
        /// Joint angles A1 to A7.
        pub q: [f64; 7] = "rad",
        /// Angles of the pendulum about base y and x: of its hinges, unwrapped; of a spherical one, its rotation vector.
        pub slosh: [f64; 2] = "rad",
        /// Direction from the pendulum's pivot to its bob.
        pub slosh_direction_B: [f64; 3] = "1" in "B",
        /// Angle of the pendulum from its hanging position, 0 to pi.
        pub slosh_swing: f64 = "rad",
        /// Angular velocity of the base.
        pub omega_NB_B: [f64; 3] = "rad/s" in "B",
        /// Velocity of the base's origin.
        pub v_NB_B: [f64; 3] = "m/s" in "B",
        /// Joint rates.
        pub qdot: [f64; 7] = "rad/s",
        /// Rates of the pendulum about base y and x: of its hinges; of a spherical one, components of its angular velocity.
        pub slosh_rate: [f64; 2] = "rad/s",
        /// Applied torque of the wheels on the base.
        pub wheel_torque_B: [f64; 3] = "N m" in "B",
        /// Applied force of the thrusters on the base.
        pub thruster_force_B: [f64; 3] = "N" in "B",
        /// Thrust of each thruster.
        pub thrust: [f64; 12] = "N",
        /// Applied torque of the thrusters on the base.
        pub thruster_torque_B: [f64; 3] = "N m" in "B",
        /// Applied torques of the joint motors.
        pub tau: [f64; 7] = "N m",
        /// Angular momentum stored in the wheels.
        pub wheel_momentum_B: [f64; 3] = "N m s" in "B",
        /// Position of the end effector.
        pub p_NE_N: [f64; 3] = "m" in "N",
        /// Attitude of the end effector, scalar first.
        pub quat_NE: [f64; 4] = "1",
        /// Velocity of the end effector.
        pub v_NE_N: [f64; 3] = "m/s" in "N",
        /// Angular velocity of the end effector.
        pub omega_NE_E: [f64; 3] = "rad/s" in "E",
        /// Position of the target's centre of mass.
        pub p_NT_N: [f64; 3] = "m" in "N",
        /// Attitude of the target, scalar first.
        pub quat_NT: [f64; 4] = "1",
        /// Velocity of the target's centre of mass.
        pub v_NT_N: [f64; 3] = "m/s" in "N",
        /// Angular velocity of the target.
        pub omega_NT_T: [f64; 3] = "rad/s" in "T",
        /// Position of the grasp frame.
        pub p_NG_N: [f64; 3] = "m" in "N",
        /// Attitude of the grasp frame, scalar first.
        pub quat_NG: [f64; 4] = "1",
        /// Distance between end effector and grasp frame.
        pub position_error: f64 = "m",
        /// Angle between end effector and grasp frame, 0 to pi.
        pub attitude_error: f64 = "rad",
        /// Speed of the end effector's origin relative to the grasp frame's.
        pub relative_speed: f64 = "m/s",
        /// Angular speed of the end effector relative to the grasp frame.
        pub relative_rate: f64 = "rad/s",
        /// Linear momentum of servicer and target.
        pub linear_momentum_N: [f64; 3] = "kg m/s" in "N",
        /// Angular momentum of servicer, wheels and target about the world's origin.
        pub angular_momentum_N: [f64; 3] = "N m s" in "N",
        /// Kinetic and spring energy of servicer and target, without the wheels' spin.
        pub energy: f64 = "J",
        /// Work of the actuators so far.
        pub actuator_work: f64 = "J",
        /// Energy dissipated by dampers so far.
        pub damper_loss: f64 = "J",
        /// Energy lost in impacts so far: at the grasp, and in joints stopped by a brake.
        pub impact_loss: f64 = "J",
        /// Change of linear momentum less the thrusters' impulse since the start: zero but for rounding and integration error.
        pub linear_residual_N: [f64; 3] = "kg m/s" in "N",
        /// Change of angular momentum less the thrusters' angular impulse since the start: zero but for rounding and integration error.
        pub angular_residual_N: [f64; 3] = "N m s" in "N",
        /// Change of energy less work plus losses since the start: zero but for rounding and integration error.
        pub energy_residual: f64 = "J",
        /// Whether the gripper has closed on the target.
        pub grasped: bool = "1",
        /// Padding.
        pub padding: [u8; 7] = "1",
    }
}
