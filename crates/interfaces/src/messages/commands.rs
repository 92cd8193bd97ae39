//! Messages of guidance and control: set-points, commands and telemetry.

lockstep::message! {
    /// Desired pose and twist of a frame of the servicer: the end effector, or the base.
    #[allow(non_snake_case)]
    pub struct SetPoint {
        /// Time of validity of the other fields.
        pub stamp: f64 = "s",
        /// Desired position.
        pub p_ND_N: [f64; 3] = "m" in "N",
        /// Desired attitude, scalar first; zeros: no set-point yet.
        pub quat_ND: [f64; 4] = "1",
        /// Desired velocity.
        pub v_ND_N: [f64; 3] = "m/s" in "N",
        /// Desired angular velocity.
        pub omega_ND_D: [f64; 3] = "rad/s" in "D",
    }
}

lockstep::message! {
    /// Commanded forces and torques of the servicer's actuators, before actuator limits.
    #[allow(non_snake_case)]
    pub struct Command {
        /// Torque of the wheels on the base.
        pub torque_B: [f64; 3] = "N m" in "B",
        /// Force of the thrusters on the base, at its origin.
        pub force_B: [f64; 3] = "N" in "B",
        /// Torques of the joint motors A1 to A7.
        pub tau: [f64; 7] = "N m",
    }
}

lockstep::message! {
    /// Commanded torques of thruster couples on the base, in addition to the wheels.
    #[allow(non_snake_case)]
    pub struct ThrusterTorque as "Couples" {
        /// Torque on the base.
        pub torque_B: [f64; 3] = "N m" in "B",
    }
}

lockstep::enumeration! {
    /// Mode of the controller.
    pub enum ControlMode {
        /// There is no set-point yet.
        Waiting = 0,
        /// A set-point is followed.
        Tracking = 1,
        /// The stack is stabilised after a grasp.
        Stabilising = 2,
    }
}

lockstep::message! {
    /// Internal signals of the controller.
    #[allow(non_snake_case)]
    pub struct ControlTelemetry {
        /// Position error of the end effector, E minus D.
        pub p_DE_N: [f64; 3] = "m" in "N",
        /// Error quaternion of the attitude, scalar first; its sign is continuous.
        pub quat_DE: [f64; 4] = "1",
        /// The hybrid law's sign h.
        pub h: f64 = "1",
        /// Weight of the arm relative to the base.
        pub epsilon: f64 = "1",
        /// Virtual angular velocity of the base.
        pub omega_v_B: [f64; 3] = "rad/s" in "B",
        /// Virtual velocity of the base's origin.
        pub v_v_B: [f64; 3] = "m/s" in "B",
        /// Virtual joint rates.
        pub qdot_v: [f64; 7] = "rad/s",
        /// Feedback part of the base's torque.
        pub feedback_torque_B: [f64; 3] = "N m" in "B",
        /// Feedback part of the base's force.
        pub feedback_force_B: [f64; 3] = "N" in "B",
        /// Feedback part of the joint torques.
        pub feedback_tau: [f64; 7] = "N m",
        /// Commanded torque that no actuator can provide.
        pub missing_torque_B: [f64; 3] = "N m" in "B",
        /// Stabilisation: fraction of the desired deceleration that the limits allow, 0 to 1.
        pub stabilise_factor: f64 = "1",
        /// Stabilisation: torque of the gripper on the target.
        pub gripper_torque_E: [f64; 3] = "N m" in "E",
        /// Stabilisation: force of the gripper on the target.
        pub gripper_force_E: [f64; 3] = "N" in "E",
        /// Stabilisation: time from the grasp to the first instant at rest; negative before, zero while stabilisation is inactive.
        pub time_to_rest: f64 = "s",
        /// Mode of the controller.
        pub mode: ControlMode = "1",
        /// Whether the weight would have been negative and was held at zero.
        pub epsilon_clamped: bool = "1",
        /// How many channels of the feedback are at their bound.
        pub feedback_saturated: u8 = "1",
        /// Stabilisation: whether everything is at rest.
        pub at_rest: bool = "1",
        /// Padding.
        pub padding: [u8; 4] = "1",
    }
}

lockstep::enumeration! {
    /// Phase of the guidance schedule.
    pub enum GuidancePhase {
        /// Before the start: the set-point is the start pose, at rest.
        Waiting = 0,
        /// Position and attitude move.
        Pointing = 1,
        /// The attitude is that of the grasp frame, the position still closes in.
        Closing = 2,
        /// The set-point is the grasp frame.
        Tracking as "Riding" = 3,
    }
}

lockstep::message! {
    /// Internal signals of guidance and navigation.
    #[allow(non_snake_case)]
    pub struct GuidanceTelemetry {
        /// Progress of the position, 0 to 1.
        pub progress_position: f64 = "1",
        /// Progress of the attitude, 0 to 1.
        pub progress_attitude: f64 = "1",
        /// Estimated position of the target.
        pub p_NT_N: [f64; 3] = "m" in "N",
        /// Estimated attitude of the target, scalar first; zeros: not seen yet.
        pub quat_NT: [f64; 4] = "1",
        /// Estimated velocity of the target.
        pub v_NT_N: [f64; 3] = "m/s" in "N",
        /// Estimated angular velocity of the target.
        pub omega_NT_T: [f64; 3] = "rad/s" in "T",
        /// Standard deviation of the position, root sum square over three axes; zero without a filter.
        pub sigma_position: f64 = "m",
        /// Standard deviation of the attitude; zero without a filter.
        pub sigma_attitude: f64 = "rad",
        /// Age of the information about the target.
        pub target_age: f64 = "s",
        /// Normalised innovation squared of the last evaluated camera pose; zero without one.
        pub innovation: f64 = "1",
        /// Number of camera poses rejected so far.
        pub refused: u32 = "1",
        /// Phase of the schedule.
        pub phase: GuidancePhase = "1",
        /// Padding.
        pub padding: [u8; 3] = "1",
    }
}

#[cfg(test)]
mod tests {
    use super::{GuidancePhase, GuidanceTelemetry, ThrusterTorque};
    use lockstep::port::Message;

    /// The names are part of the digests of tapes.
    #[test]
    fn renamed_types_keep_their_recorded_names() {
        assert_eq!(ThrusterTorque::descriptor().name, "Couples");
        let phase = GuidanceTelemetry::descriptor();
        let phase = phase.field("phase").expect("the telemetry has a phase");
        let tracking = f64::from(GuidancePhase::Tracking as u8);
        assert_eq!(phase.name_of(tracking), Some("Riding"));
    }
}
