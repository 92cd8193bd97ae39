//! The control model: the rigid-body model of the servicer that a law uses.
//!
//! Thirteen degrees of freedom: a floating base and the joints of the arm. The propellant is either a rigid mass welded to the base at the
//! pendulum's hanging position, or left out. Masses and inertias can be scaled relative to the description, because the hierarchical law
//! claims robustness against exactly such errors.

use crate::{Dof, JOINTS, Jacobian, Matrix13, Measured};
use guidance_laws::{Pose, so3};
use multibody::{Description, FrameId, Inertia, Joint, JointKind, Link, Placement, Tree};
use nalgebra::{Rotation3, SVector, UnitQuaternion, Vector3};
use thiserror::Error;

/// Treatment of the joints that do not belong to the arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Propellant {
    /// They are welded at angle zero: the pendulum is a rigid mass at its hanging position.
    #[default]
    Frozen,
    /// The links that they carry are left out.
    Ignored,
}

/// Mass and inertia of a link in the control model relative to the description.
#[derive(Debug, Clone, PartialEq)]
pub struct LinkMismatch {
    /// The link.
    pub link: String,
    /// Factor on its mass, which also scales its inertia.
    pub mass_factor: f64,
    /// Further factor on its inertia about the centre of mass.
    pub inertia_factor: f64,
}

/// A rigid body welded to the end effector, as after a capture.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Payload {
    /// Pose of the payload's body frame in the end effector's frame.
    pub pose: Pose,
    /// Mass, centre of mass and inertia, payload axes.
    pub inertia: Inertia,
}

/// User options of the control model.
#[derive(Debug, Clone, PartialEq)]
pub struct ModelOptions {
    /// Names of the arm's joints, in the order of the generalised velocity.
    pub arm_joints: [String; JOINTS],
    /// Name of the link that is the end effector's frame.
    pub end_effector: String,
    /// Treatment of the joints that do not belong to the arm.
    pub propellant: Propellant,
    /// Reflected rotor inertia of each joint, kg m²; it replaces the description's.
    pub motor_inertia_kg_m2: [f64; JOINTS],
    /// Factor on every mass and inertia.
    pub mass_factor: f64,
    /// Additional factors on single links.
    pub mismatch: Vec<LinkMismatch>,
    /// A body welded to the end effector.
    pub payload: Option<Payload>,
}

impl Default for ModelOptions {
    /// The stock servicer: joints A1 to A7, frame `end_effector`, propellant frozen, 0.1 kg m² of rotor inertia on every joint.
    fn default() -> Self {
        Self {
            arm_joints: ["A1", "A2", "A3", "A4", "A5", "A6", "A7"].map(str::to_owned),
            end_effector: "end_effector".to_owned(),
            propellant: Propellant::default(),
            motor_inertia_kg_m2: [0.1; JOINTS],
            mass_factor: 1.0,
            mismatch: Vec::new(),
            payload: None,
        }
    }
}

/// Why a control model cannot be built.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ModelError {
    /// A name or a value does not fit the description.
    #[error("control model: {0}")]
    Edit(#[from] multibody::EditError),
    /// The remaining mechanism does not have seven joints on a floating base.
    #[error("control model: {0}")]
    Tree(#[from] multibody::TreeError),
    /// There is no such end effector.
    #[error("control model: end_effector: {0}")]
    EndEffector(#[from] multibody::UnknownFrame),
    /// There is no such joint.
    #[error("control model: arm_joints: there is no moving joint `{joint}`; there are: {known}")]
    NoSuchJoint {
        /// The requested joint.
        joint: String,
        /// The existing joints.
        known: String,
    },
    /// The joints are in another order.
    #[error(
        "control model: arm_joints = {asked:?}, but the description has them as {found:?}; name them in that order"
    )]
    JointOrder {
        /// The requested order.
        asked: Vec<String>,
        /// The order of the description.
        found: Vec<String>,
    },
    /// A rotor inertia is negative or not finite.
    #[error("control model: motor_inertia_kg_m2 of `{joint}` = {value}: must be a finite number, zero or above")]
    MotorInertia {
        /// The joint.
        joint: String,
        /// The value.
        value: f64,
    },
}

/// Pose of the end effector and its Jacobian.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EndEffector {
    /// Pose in the world.
    pub pose: Pose,
    /// Body Jacobian `J_v`: generalised velocity to `[w_NE; v_NE]` in end-effector axes (rad/s, m/s).
    pub jacobian: Jacobian,
}

/// The control model.
#[derive(Debug, Clone)]
pub struct ControlModel {
    tree: Tree<7, 13>,
    end_effector: FrameId,
}

impl ControlModel {
    /// A model of the mechanism in `description`. Allocates; the methods do not.
    ///
    /// # Errors
    ///
    /// Names the joint, link or frame that is missing or out of range.
    pub fn new(description: &Description, options: &ModelOptions) -> Result<Self, ModelError> {
        let mut description = description.clone();
        let known: Vec<&str> = description.moving_joints().map(|joint| joint.name.as_str()).collect();
        if let Some(joint) = options.arm_joints.iter().find(|name| !known.contains(&name.as_str())) {
            return Err(ModelError::NoSuchJoint {
                joint: joint.clone(),
                known: known.join(", "),
            });
        }
        let others: Vec<(String, usize)> = description
            .moving_joints()
            .filter(|joint| !options.arm_joints.contains(&joint.name))
            .map(|joint| (joint.name.clone(), joint.child))
            .collect();
        let branches: Vec<String> = others
            .iter()
            .map(|(_, child)| description.links[*child].name.clone())
            .collect();
        for ((joint, _), branch) in others.iter().zip(&branches) {
            match options.propellant {
                Propellant::Frozen => description.freeze(joint, 0.0)?,
                // a branch below one that is already removed is removed with it
                Propellant::Ignored if description.links.iter().any(|link| link.name == *branch) => {
                    description.remove_branch(branch)?
                }
                Propellant::Ignored => &mut description,
            };
        }
        for (name, &value) in options.arm_joints.iter().zip(&options.motor_inertia_kg_m2) {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(ModelError::MotorInertia {
                    joint: name.clone(),
                    value,
                });
            }
            for joint in description.joints.iter_mut().filter(|joint| joint.name == *name) {
                joint.motor_inertia = value;
            }
        }
        description.scale_all(options.mass_factor)?;
        for mismatch in &options.mismatch {
            description
                .scale_mass(&mismatch.link, mismatch.mass_factor)?
                .scale_inertia(&mismatch.link, mismatch.inertia_factor)?;
        }
        if let Some(payload) = &options.payload {
            weld(&mut description, &options.end_effector, payload);
        }
        let tree = Tree::<7, 13>::new(&description)?;
        if tree.joint_names() != options.arm_joints {
            return Err(ModelError::JointOrder {
                asked: options.arm_joints.to_vec(),
                found: tree.joint_names().to_vec(),
            });
        }
        let end_effector = tree.frame(&options.end_effector)?;
        Ok(Self { tree, end_effector })
    }

    /// The rigid-body tree behind the model.
    pub fn tree(&self) -> &Tree<7, 13> {
        &self.tree
    }

    /// Pose and Jacobian of the end effector.
    pub fn end_effector(&self, measured: &Measured) -> EndEffector {
        let kinematics = self
            .tree
            .kinematics(&SVector::from(measured.joints), &measured.velocity);
        let Placement { p: p_BE, r: R_BE } = self.tree.placement(&kinematics, self.end_effector);
        let q_BE = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(R_BE));
        EndEffector {
            pose: Pose {
                position: measured.base.position + measured.base.attitude * p_BE,
                attitude: so3::normalised(measured.base.attitude.into_inner() * q_BE.into_inner()),
            },
            jacobian: self.tree.jacobian(&kinematics, self.end_effector),
        }
    }

    /// Generalised force `M(q) a + C(q, ṽ) v` in one Newton-Euler pass (Eq 5), with the factorisation of `C` for which `Ṁ − 2C` is skew.
    pub fn force(&self, measured: &Measured, velocity: &Dof, acceleration: &Dof) -> Dof {
        let joints = SVector::from(measured.joints);
        self.tree
            .mass_coriolis_product(&joints, &measured.velocity, acceleration, velocity)
    }

    /// Mass matrix `M(q)`: kg m², kg m and kg, order of the generalised velocity.
    pub fn mass(&self, measured: &Measured) -> Matrix13 {
        self.tree.mass_matrix(&SVector::from(measured.joints))
    }

    /// Generalised momentum `M(q) ṽ`: angular about B's origin, linear, joints.
    pub fn momentum(&self, measured: &Measured) -> Dof {
        let joints = SVector::from(measured.joints);
        self.tree
            .mass_coriolis_product(&joints, &Dof::zeros(), &measured.velocity, &Dof::zeros())
    }

    /// Centre of mass of the servicer from B's origin, base axes, m.
    pub fn centre_of_mass(&self, measured: &Measured) -> Vector3<f64> {
        let kinematics = self
            .tree
            .kinematics(&SVector::from(measured.joints), &measured.velocity);
        self.tree.momentum(&kinematics).p_bc
    }
}

/// Adds the payload as a separate link. A missing end effector is detected when its frame is looked up.
fn weld(description: &mut Description, end_effector: &str, payload: &Payload) {
    let Some(parent) = description.links.iter().position(|link| link.name == end_effector) else {
        return;
    };
    description.links.push(Link {
        name: "payload".to_owned(),
        inertia: Some(payload.inertia),
    });
    description.joints.push(Joint {
        name: "grasp".to_owned(),
        kind: JointKind::Fixed,
        parent,
        child: description.links.len() - 1,
        origin: Placement {
            p: payload.pose.position,
            r: payload.pose.attitude.to_rotation_matrix().into_inner(),
        },
        axis: Vector3::z(),
        limits: None,
        damping: 0.0,
        friction: 0.0,
        stiffness: 0.0,
        rest: 0.0,
        motor_inertia: 0.0,
        mimic: None,
    });
}
