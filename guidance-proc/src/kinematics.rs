//! Forward kinematics: the end effector's pose from the servicer's own sensors.

use guidance_laws::{Pose, so3};
use interfaces::files::Servicer;
use interfaces::{JOINTS, Measured};
use lockstep::participant::ParameterError;
use multibody::{FrameId, Tree};
use nalgebra::{Rotation3, SVector, UnitQuaternion};

/// The arm on its base, the propellant's hinges welded: only positions matter here.
#[derive(Debug, Clone)]
pub struct Kinematics {
    tree: Tree<JOINTS, { 6 + JOINTS }>,
    end_effector: FrameId,
}

impl Kinematics {
    /// Builds the kinematics from the URDF.
    ///
    /// # Errors
    /// Names the item that does not fit the URDF.
    pub fn new(urdf: &str, servicer: &Servicer) -> Result<Self, ParameterError> {
        let refuse = |key: &str, error: &dyn std::fmt::Display| ParameterError::new(key, error);
        let mut description = servicer.description(urdf).map_err(|error| refuse("urdf", &error))?;
        for joint in &servicer.slosh.joints {
            description
                .freeze(joint, 0.0)
                .map_err(|error| refuse("servicer.slosh", &error))?;
        }
        for (joint, inertia) in servicer.arm.joints.iter().zip(servicer.arm.motor_inertia.si()) {
            description
                .add_motor_inertia(joint, inertia)
                .map_err(|error| refuse("servicer.arm", &error))?;
        }
        let tree = Tree::new(&description).map_err(|error| refuse("urdf", &error))?;
        if tree.joint_names() != servicer.arm.joints {
            let reason = format!(
                "the URDF has the joints in the order {:?}; name them so",
                tree.joint_names()
            );
            return Err(ParameterError::new("servicer.arm.joints", reason));
        }
        let end_effector = tree
            .frame(&servicer.arm.end_effector)
            .map_err(|error| refuse("servicer.arm.end_effector", &error))?;
        Ok(Self { tree, end_effector })
    }

    /// Poses of base and end effector; `None` before the first measurement.
    pub fn poses(&self, measured: &Measured) -> Option<(Pose, Pose)> {
        let base = Pose::from_raw(measured.p_NB_N, measured.quat_NB)?;
        let kinematics = self.tree.kinematics(&SVector::from(measured.q), &SVector::zeros());
        let placement = self.tree.placement(&kinematics, self.end_effector);
        let q_BE = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(placement.r));
        let end_effector = Pose {
            position: base.position + base.attitude * placement.p,
            attitude: so3::normalised(base.attitude.into_inner() * q_BE.into_inner()),
        };
        Some((base, end_effector))
    }
}
