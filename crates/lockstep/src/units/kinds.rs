//! The kinds of quantity that the stock parameters need. A project adds its own by implementing [`QuantityKind`].

use super::{Dimension, QuantityKind};

macro_rules! kinds {
    ($($(#[$meta:meta])* $name:ident: $words:literal, $example:literal, [$m:literal, $kg:literal, $s:literal, $rad:literal];)*) => {$(
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub struct $name;

        impl QuantityKind for $name {
            const DIMENSION: Dimension = Dimension::new($m, $kg, $s, $rad);
            const WORDS: &'static str = $words;
            const EXAMPLE: &'static str = $example;
        }
    )*};
}

kinds! {
    /// A length, m.
    Length: "a length", "0.5 m", [1, 0, 0, 0];
    /// A mass, kg.
    Mass: "a mass", "12 kg", [0, 1, 0, 0];
    /// A time, s.
    Time: "a time", "10 ms", [0, 0, 1, 0];
    /// A rate without angle, such as a bandwidth, 1/s.
    PerTime: "a rate", "0.3 1/s", [0, 0, -1, 0];
    /// An angle, rad.
    Angle: "an angle", "30 deg", [0, 0, 0, 1];
    /// A velocity, m/s.
    Speed: "a speed", "2 mm/s", [1, 0, -1, 0];
    /// An acceleration, m/s².
    Acceleration: "an acceleration", "0.1 m/s^2", [1, 0, -2, 0];
    /// An angular velocity, rad/s.
    AngularRate: "an angular rate", "0.2 deg/s", [0, 0, -1, 1];
    /// An angular acceleration, rad/s².
    AngularAcceleration: "an angular acceleration", "0.1 deg/s^2", [0, 0, -2, 1];
    /// A moment of inertia, kg m².
    Inertia: "a moment of inertia", "0.1 kg m^2", [2, 1, 0, 0];
    /// A force, N.
    Force: "a force", "9 N", [1, 1, -2, 0];
    /// A torque, N m.
    Torque: "a torque", "0.2 N m", [2, 1, -2, 0];
    /// An angular momentum, N m s.
    AngularMomentum: "an angular momentum", "12 N m s", [2, 1, -1, 0];
    /// A linear momentum or impulse, N s.
    Impulse: "an impulse", "0.1 N s", [1, 1, -1, 0];
    /// Torque per angular velocity, N m s/rad: rotational damping.
    RotationalDamping: "a torque per angular rate", "0.0131 kg m^2/s", [2, 1, -1, -1];
    /// Torque per angle, N m/rad.
    RotationalStiffness: "a torque per angle", "0.5 N m/rad", [2, 1, -2, -1];
    /// Force per velocity, N s/m.
    LinearDamping: "a force per speed", "450 N s/m", [0, 1, -1, 0];
    /// Force per length, N/m.
    LinearStiffness: "a force per length", "90 N/m", [0, 1, -2, 0];
    /// Energy, J.
    Energy: "an energy", "0.5 J", [2, 1, -2, 0];
    /// Slow drift of an angular rate: its random walk, rad/s per square root of a second, squared: rad²/s³.
    AngularRateWalk: "a random walk of an angular rate, squared", "1e-16 rad^2/s^3", [0, 0, -3, 2];
}
