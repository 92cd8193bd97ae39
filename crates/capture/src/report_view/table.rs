//! Table of figures: what the report draws, from which fields, in one place.
//!
//! A row names ports and fields, never types. A field may have several names (the first that a stream has is used); a curve
//! whose fields no stream has is left out, and a figure without curves too. So the table serves the stock participants,
//! their variants, and every user's participant that uses the same names.

/// The names of the field with the arm's joint angles, rad.
pub(super) const ARM_ANGLES: Names = &["q"];
/// The names of the field with the slosh pendulum's joint angles, rad.
pub(super) const SLOSH_ANGLES: Names = &["slosh", "q_slosh"];

/// A figure.
pub(super) struct FigureSpec {
    /// Identifier, short and stable: used in file names and anchors.
    pub(super) id: &'static str,
    /// The heading of the figure's section on the page.
    pub(super) group: &'static str,
    pub(super) title: &'static str,
    /// The unit drawn.
    pub(super) unit: &'static str,
    /// The factor from the unit of the fields to the unit drawn.
    pub(super) scale: f64,
    pub(super) curves: &'static [Curve],
    /// The key of the limits, in the fields' unit, in the result of [`super::actuator_limits`].
    pub(super) limits: Option<&'static str>,
}

/// Curves computed from one stream.
pub(super) struct Curve {
    /// The name of the port, of any participant.
    pub(super) port: &'static str,
    pub(super) formula: Formula,
    /// One label per curve; empty: `x y z`, or numbers.
    pub(super) labels: &'static [&'static str],
}

/// The names a field may have.
pub(super) type Names = &'static [&'static str];

/// The quantity that is drawn of the fields.
#[derive(Clone, Copy)]
pub(super) enum Formula {
    /// Every element.
    Each(Names),
    /// Elements `from..to`.
    Part(Names, usize, usize),
    /// The Euclidean length.
    Norm(Names),
    /// The length of the difference of two vectors.
    Distance(Names, Names),
    /// The angle between two attitudes (quaternions, scalar first), rad.
    Angle(Names, Names),
    /// A position relative to an origin, both in world axes, transformed to the axes of an attitude.
    PositionIn(Names, Names, Names),
    /// The vector part of the relative quaternion from one attitude to another, for the shorter rotation.
    AttitudeIn(Names, Names),
    /// The rotation vector of an attitude, rad.
    RotationVector(Names),
    /// The momentum of each body, of the wheels and of all together.
    Bodies(MomentumQuantity),
}

/// The quantity of a figure of the bodies' momenta.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum MomentumQuantity {
    /// Linear momentum along a world axis, kg m/s.
    Linear(usize),
    /// Angular momentum along a world axis about the common centre of mass, of the motion relative to it, N m s.
    Angular(usize),
    /// The position of the common centre of mass, world axes, m.
    Centre,
}

use Formula::{Angle, AttitudeIn, Bodies, Distance, Each, Norm, Part, PositionIn, RotationVector};

const DEGREES: f64 = 180.0 / std::f64::consts::PI;

const P_NB: Names = &["p_NB_N"];
const QUAT_NB: Names = &["quat_NB"];
const P_NE: Names = &["p_NE_N"];
const QUAT_NE: Names = &["quat_NE"];
const P_NG: Names = &["p_NG_N"];
const QUAT_NG: Names = &["quat_NG"];
const P_ND: Names = &["p_ND_N"];
/// The names of the field with the torque on the base, N m.
pub(super) const TORQUE: Names = &["torque_B", "base_torque", "wheel_torque_B"];
/// The names of the field with the force on the base, N.
pub(super) const FORCE: Names = &["force_B", "base_force", "thruster_force_B"];
const JOINT_TORQUE: Names = &["tau", "joint_torque"];
const JOINTS: &[&str] = &["A1", "A2", "A3", "A4", "A5", "A6", "A7"];
const CHANNELS: &[&str] = &[
    "torque x", "torque y", "torque z", "force x", "force y", "force z", "A1", "A2", "A3", "A4", "A5", "A6", "A7",
];

const fn curve(port: &'static str, formula: Formula, labels: &'static [&'static str]) -> Curve {
    Curve { port, formula, labels }
}

const fn figure(
    group: &'static str,
    id: &'static str,
    title: &'static str,
    (unit, scale): (&'static str, f64),
    curves: &'static [Curve],
) -> FigureSpec {
    FigureSpec {
        id,
        group,
        title,
        unit,
        scale,
        curves,
        limits: None,
    }
}

const fn with_limits(mut figure: FigureSpec, key: &'static str) -> FigureSpec {
    figure.limits = Some(key);
    figure
}

const CAPTURE: &str = "Capture";
const ACTIONS: &str = "Control actions";
const INSIDE: &str = "Inside the controller";
const GUIDANCE: &str = "Guidance and navigation";
const MOTION: &str = "Motion";
const BALANCE: &str = "Momentum and energy";

/// Every figure, in the order of the page.
pub(super) const FIGURES: &[FigureSpec] = &[
    figure(
        CAPTURE,
        "position-error",
        "End effector to grasp point, distance",
        ("m", 1.0),
        &[curve("truth", Distance(P_NE, P_NG), &["distance"])],
    ),
    figure(
        CAPTURE,
        "attitude-error",
        "End effector to grasp point, angle",
        ("deg", DEGREES),
        &[curve("truth", Angle(QUAT_NE, QUAT_NG), &["angle"])],
    ),
    figure(
        CAPTURE,
        "position-error-in-grasp",
        "End effector from the grasp point, in the axes of the grasp frame",
        ("m", 1.0),
        &[curve("truth", PositionIn(P_NE, P_NG, QUAT_NG), &[])],
    ),
    figure(
        CAPTURE,
        "attitude-error-in-grasp",
        "Vector part of the end effector's quaternion in the grasp frame",
        ("1", 1.0),
        &[curve("truth", AttitudeIn(QUAT_NE, QUAT_NG), &[])],
    ),
    figure(
        CAPTURE,
        "tracking-error",
        "End effector to set-point, distance",
        ("m", 1.0),
        &[curve("telemetry", Norm(&["p_DE_N"]), &["distance"])],
    ),
    with_limits(
        figure(
            ACTIONS,
            "base-torque",
            "Base torque demanded",
            ("N m", 1.0),
            &[curve("command", Each(TORQUE), &[])],
        ),
        "base_torque",
    ),
    with_limits(
        figure(
            ACTIONS,
            "base-force",
            "Base force demanded",
            ("N", 1.0),
            &[curve("command", Each(FORCE), &[])],
        ),
        "base_force",
    ),
    with_limits(
        figure(
            ACTIONS,
            "joint-torque",
            "Joint torques demanded",
            ("N m", 1.0),
            &[curve("command", Each(JOINT_TORQUE), JOINTS)],
        ),
        "joint_torque",
    ),
    with_limits(
        figure(
            ACTIONS,
            "base-torque-applied",
            "Base torque applied",
            ("N m", 1.0),
            &[curve("truth", Each(TORQUE), &[])],
        ),
        "base_torque",
    ),
    with_limits(
        figure(
            ACTIONS,
            "base-force-applied",
            "Base force applied",
            ("N", 1.0),
            &[curve("truth", Each(FORCE), &[])],
        ),
        "base_force",
    ),
    with_limits(
        figure(
            ACTIONS,
            "joint-torque-applied",
            "Joint torques applied",
            ("N m", 1.0),
            &[curve("truth", Each(JOINT_TORQUE), JOINTS)],
        ),
        "joint_torque",
    ),
    figure(
        ACTIONS,
        "thruster-torque",
        "Torque that the thrusters make on the base",
        ("N m", 1.0),
        &[curve("truth", Each(&["thruster_torque_B"]), &[])],
    ),
    figure(
        INSIDE,
        "epsilon",
        "Weight of the arm in the pseudoinverse, ε",
        ("1", 1.0),
        &[
            curve("telemetry", Each(&["epsilon"]), &["ε"]),
            curve("telemetry", Each(&["epsilon_clamped"]), &["held at zero"]),
        ],
    ),
    figure(
        INSIDE,
        "hybrid-variable",
        "Hybrid variable h",
        ("1", 1.0),
        &[curve("telemetry", Each(&["h"]), &["h"])],
    ),
    figure(
        INSIDE,
        "integrator-base",
        "Integrator state σ, base",
        ("1", 1.0),
        &[curve("telemetry", Part(&["sigma"], 0, 6), CHANNELS)],
    ),
    figure(
        INSIDE,
        "integrator-arm",
        "Integrator state σ, arm",
        ("1", 1.0),
        &[curve("telemetry", Part(&["sigma"], 6, 13), JOINTS)],
    ),
    figure(
        INSIDE,
        "feedback-torque",
        "Feedback part of the base torque",
        ("N m", 1.0),
        &[curve("telemetry", Each(&["feedback_torque_B"]), &[])],
    ),
    figure(
        INSIDE,
        "feedback-force",
        "Feedback part of the base force",
        ("N", 1.0),
        &[curve("telemetry", Each(&["feedback_force_B"]), &[])],
    ),
    figure(
        INSIDE,
        "feedback-joints",
        "Feedback part of the joint torques",
        ("N m", 1.0),
        &[curve("telemetry", Each(&["feedback_tau"]), JOINTS)],
    ),
    figure(
        INSIDE,
        "saturation",
        "Channels in saturation",
        ("1", 1.0),
        &[
            curve("telemetry", Each(&["feedback_saturated"]), &["number of channels"]),
            curve("telemetry", Part(&["saturated"], 0, 13), CHANNELS),
        ],
    ),
    figure(
        GUIDANCE,
        "progress",
        "Progress of the set-point",
        ("1", 1.0),
        &[
            curve("telemetry", Each(&["progress_position"]), &["position"]),
            curve("telemetry", Each(&["progress_attitude"]), &["attitude"]),
        ],
    ),
    figure(
        GUIDANCE,
        "set-point",
        "Set-point of the end effector",
        ("m", 1.0),
        &[curve("setpoint", Each(P_ND), &[])],
    ),
    figure(
        GUIDANCE,
        "target-uncertainty",
        "Standard deviation of the target's position",
        ("m", 1.0),
        &[curve("telemetry", Each(&["sigma_position"]), &["position"])],
    ),
    figure(
        GUIDANCE,
        "target-age",
        "Age of what guidance knows of the target",
        ("s", 1.0),
        &[curve("telemetry", Each(&["target_age"]), &["age"])],
    ),
    figure(
        MOTION,
        "slosh",
        "Slosh pendulum",
        ("deg", DEGREES),
        &[curve("truth", Each(SLOSH_ANGLES), &["first joint", "second joint"])],
    ),
    figure(
        MOTION,
        "end-effector-position",
        "End effector position",
        ("m", 1.0),
        &[curve("truth", Each(P_NE), &[])],
    ),
    figure(
        MOTION,
        "base-position",
        "Base position",
        ("m", 1.0),
        &[curve("truth", Each(P_NB), &[])],
    ),
    figure(
        MOTION,
        "base-attitude",
        "Base attitude, rotation vector",
        ("deg", DEGREES),
        &[curve("truth", RotationVector(QUAT_NB), &[])],
    ),
    figure(
        MOTION,
        "base-velocity",
        "Base velocity, body axes",
        ("m/s", 1.0),
        &[curve("truth", Each(&["v_NB_B"]), &[])],
    ),
    figure(
        MOTION,
        "base-rate",
        "Base rate, body axes",
        ("deg/s", DEGREES),
        &[curve("truth", Each(&["omega_NB_B"]), &[])],
    ),
    figure(
        MOTION,
        "joint-angles",
        "Joint angles",
        ("deg", DEGREES),
        &[curve("truth", Each(ARM_ANGLES), JOINTS)],
    ),
    figure(
        MOTION,
        "joint-rates",
        "Joint rates",
        ("deg/s", DEGREES),
        &[curve("truth", Each(&["qdot"]), JOINTS)],
    ),
    figure(
        BALANCE,
        "linear-momentum",
        "Linear momentum of servicer and target",
        ("N s", 1.0),
        &[curve("truth", Each(&["linear_momentum_N"]), &[])],
    ),
    figure(
        BALANCE,
        "angular-momentum",
        "Angular momentum about the world's origin",
        ("N m s", 1.0),
        &[curve("truth", Each(&["angular_momentum_N", "momentum_angular_N"]), &[])],
    ),
    figure(
        BALANCE,
        "linear-momentum-x",
        "Linear momentum of each body, x",
        ("N s", 1.0),
        &[curve("truth", Bodies(MomentumQuantity::Linear(0)), &[])],
    ),
    figure(
        BALANCE,
        "linear-momentum-y",
        "Linear momentum of each body, y",
        ("N s", 1.0),
        &[curve("truth", Bodies(MomentumQuantity::Linear(1)), &[])],
    ),
    figure(
        BALANCE,
        "linear-momentum-z",
        "Linear momentum of each body, z",
        ("N s", 1.0),
        &[curve("truth", Bodies(MomentumQuantity::Linear(2)), &[])],
    ),
    figure(
        BALANCE,
        "angular-momentum-x",
        "Angular momentum about the common centre of mass, x",
        ("N m s", 1.0),
        &[curve("truth", Bodies(MomentumQuantity::Angular(0)), &[])],
    ),
    figure(
        BALANCE,
        "angular-momentum-y",
        "Angular momentum about the common centre of mass, y",
        ("N m s", 1.0),
        &[curve("truth", Bodies(MomentumQuantity::Angular(1)), &[])],
    ),
    figure(
        BALANCE,
        "angular-momentum-z",
        "Angular momentum about the common centre of mass, z",
        ("N m s", 1.0),
        &[curve("truth", Bodies(MomentumQuantity::Angular(2)), &[])],
    ),
    figure(
        BALANCE,
        "centre-of-mass",
        "Common centre of mass of servicer and target",
        ("m", 1.0),
        &[curve("truth", Bodies(MomentumQuantity::Centre), &[])],
    ),
    with_limits(
        figure(
            BALANCE,
            "wheel-momentum",
            "Momentum stored in the wheels",
            ("N m s", 1.0),
            &[curve("truth", Each(&["wheel_momentum_B"]), &[])],
        ),
        "wheel_momentum",
    ),
    figure(
        BALANCE,
        "energy",
        "Energy",
        ("J", 1.0),
        &[
            curve("truth", Each(&["energy"]), &["kinetic and spring"]),
            curve("truth", Each(&["actuator_work"]), &["actuator work"]),
            curve("truth", Each(&["damper_loss"]), &["lost in dampers"]),
            curve("truth", Each(&["impact_loss"]), &["lost in impacts"]),
        ],
    ),
    figure(
        BALANCE,
        "momentum-residual",
        "Angular momentum that the books do not explain",
        ("N m s", 1.0),
        &[curve("truth", Each(&["angular_residual_N"]), &[])],
    ),
    figure(
        BALANCE,
        "energy-residual",
        "Energy that the books do not explain",
        ("J", 1.0),
        &[curve("truth", Each(&["energy_residual"]), &["residual"])],
    ),
];
