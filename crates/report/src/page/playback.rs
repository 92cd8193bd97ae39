//! The channels of the 3-D playback.

use crate::geometry::{ARM_ANGLES, SLOSH_ANGLES};

/// The names a field may have.
type Names = &'static [&'static str];

const P_NB: Names = &["p_NB_N"];
const QUAT_NB: Names = &["quat_NB"];
const P_NE: Names = &["p_NE_N"];
const QUAT_NE: Names = &["quat_NE"];
const P_NG: Names = &["p_NG_N"];
const QUAT_NG: Names = &["quat_NG"];
const P_NT: Names = &["p_NT_N"];
const QUAT_NT: Names = &["quat_NT"];
const P_ND: Names = &["p_ND_N"];
const TORQUE: Names = &["torque_B", "base_torque", "wheel_torque_B"];
const FORCE: Names = &["force_B", "base_force", "thruster_force_B"];

/// The channels of the 3-D playback: the name it knows, the port, and the names the field may have.
pub(crate) const PLAYBACK: &[(&str, &str, Names)] = &[
    ("p_NB", "truth", P_NB),
    ("quat_NB", "truth", QUAT_NB),
    ("q", "truth", ARM_ANGLES),
    ("q_slosh", "truth", SLOSH_ANGLES),
    ("p_NE", "truth", P_NE),
    ("quat_NE", "truth", QUAT_NE),
    ("p_NG", "truth", P_NG),
    ("quat_NG", "truth", QUAT_NG),
    ("torque", "truth", TORQUE),
    ("force", "truth", FORCE),
    ("p_NT", "truth", P_NT),
    ("quat_NT", "truth", QUAT_NT),
    ("p_NT", "target", P_NT),
    ("quat_NT", "target", QUAT_NT),
    ("p_ND", "setpoint", P_ND),
    ("command_torque", "command", TORQUE),
    ("command_force", "command", FORCE),
];
