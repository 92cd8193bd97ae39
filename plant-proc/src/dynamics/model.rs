//! The mechanisms: the servicer before and after the grasp, and the target.

use std::sync::atomic::{AtomicU64, Ordering};

use interfaces::files;
use lockstep::participant::ParameterError;
use multibody::{Description, FrameId, Inertia, Kinematics, Placement, Quaternion, rotation};
use nalgebra::{Matrix3, Rotation3, SMatrix, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::spherical_pendulum::{SphericalPendulum, perpendicular_directions};
use super::{COORDINATES, Generalised, Motion, Servicer, SloshModel, Target, TargetTree, Tree, VELOCITIES};

/// The constants of a run.
#[derive(Debug, Clone)]
pub struct Model {
    /// Models with the same version have the same constants.
    pub version: u64,
    /// The servicer, after the grasp with the target welded to it.
    pub tree: Tree,
    /// The same with a spherical pendulum in place of the two hinges, if selected. `tree` then provides the geometry only.
    pub spherical: Option<SphericalPendulum>,
    /// The end effector.
    pub end_effector: FrameId,
    /// The target on its own.
    pub target: TargetTree,
    /// Mass of the target, kg, and inertia about its centre of mass, target axes, kg m².
    pub target_inertia: Inertia,
    /// Pose of the grasp frame in the target's.
    pub grasp: Placement,
    /// Attitude of the grasp frame in the target's.
    pub quat_TG: Quaternion,
}

/// How the gripper holds the target, and the energy lost when it closed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Grasp {
    /// Pose of the target's body frame in the end effector's.
    pub held: Placement,
    /// Energy lost in the impact, J.
    pub loss: f64,
}

impl Model {
    /// Builds the mechanisms.
    ///
    /// # Errors
    /// Names the file and what does not fit.
    pub fn new(
        urdf: &str,
        servicer: &files::Servicer,
        target: &files::Target,
        slosh_model: SloshModel,
    ) -> Result<Self, ParameterError> {
        let refuse = |key: &str, error: &dyn std::fmt::Display| ParameterError::new(key, error);
        let mut description = servicer.description(urdf).map_err(|error| refuse("urdf", &error))?;
        for (name, inertia) in servicer.arm.joints.iter().zip(servicer.arm.motor_inertia.si()) {
            description
                .add_motor_inertia(name, inertia)
                .map_err(|error| refuse("servicer.arm", &error))?;
        }
        let slosh = |error| refuse("servicer.slosh", &error);
        for name in &servicer.slosh.joints {
            if let Some(damping) = servicer.slosh.damping {
                description.set_damping(name, damping.si()).map_err(slosh)?;
            }
            let stiffness = servicer.slosh.stiffness.si();
            description.set_stiffness(name, stiffness, 0.0).map_err(slosh)?;
        }
        let tree = Tree::new(&description).map_err(|error| refuse("urdf", &error))?;
        let expected: Vec<&String> = servicer.arm.joints.iter().chain(&servicer.slosh.joints).collect();
        if !tree.joint_names().iter().eq(expected.iter().copied()) {
            return Err(ParameterError::new(
                "servicer",
                format!(
                    "arm.joints and slosh.joints name {expected:?}, but the URDF moves {:?}; name all of them in that order",
                    tree.joint_names()
                ),
            ));
        }
        let end_effector = tree
            .frame(&servicer.arm.end_effector)
            .map_err(|error| refuse("servicer.arm.end_effector", &error))?;
        target.validate()?;
        let target_inertia = Inertia {
            mass: target.mass.si(),
            com: Vector3::zeros(),
            about_com: Matrix3::from_diagonal(&Vector3::from(target.inertia.si())),
        };
        let body =
            Description::rigid_body("target", target_inertia).map_err(|error| refuse("target.inertia", &error))?;
        let [roll, pitch, yaw] = target.grasp.attitude.si();
        let spherical = match slosh_model {
            SloshModel::Hinges => None,
            SloshModel::Spherical => {
                let spherical = SphericalPendulum::new(&description, servicer).map_err(|reason| {
                    refuse(
                        "slosh",
                        &format!("`spherical` does not fit the URDF: {reason}; or write \"hinges\""),
                    )
                })?;
                Some(spherical)
            }
        };
        let grasp = Placement {
            p: target.grasp.position.si().into(),
            r: rotation::roll_pitch_yaw(roll, pitch, yaw),
        };
        Ok(Self {
            version: next_version(),
            tree,
            spherical,
            end_effector,
            target: TargetTree::new(&body).map_err(|error| refuse("target.inertia", &error))?,
            target_inertia,
            quat_TG: quaternion_of(&grasp.r),
            grasp,
        })
    }

    /// Poses and rates of the servicer's bodies.
    pub fn kinematics(&self, servicer: &Servicer) -> Kinematics<COORDINATES, VELOCITIES> {
        self.tree.kinematics(&servicer.q, &servicer.nu)
    }

    /// Motion of a frame that is welded to the end effector at `held`.
    pub fn held_target_motion(&self, servicer: &Servicer, held: &Placement) -> Target {
        let kinematics = self.kinematics(servicer);
        let placement = self.tree.placement(&kinematics, self.end_effector).then(held);
        let (omega, v) = self.twist(&kinematics, servicer);
        let omega_t = held.r.transpose() * omega;
        let v_t = held.r.transpose() * (v + omega.cross(&held.p));
        let mut target = Target::rest();
        target.p_nb = servicer.p_nb + servicer.quat_nb.rotate(&placement.p);
        target.quat_nb = servicer.quat_nb.times(quaternion_of(&placement.r));
        for axis in 0..3 {
            target.nu[axis] = omega_t[axis];
            target.nu[3 + axis] = v_t[axis];
        }
        target
    }

    /// Twist of the end effector in its own axes: ω_NE, v_NE.
    pub fn twist(
        &self,
        kinematics: &Kinematics<COORDINATES, VELOCITIES>,
        servicer: &Servicer,
    ) -> (Vector3<f64>, Vector3<f64>) {
        let twist = self.tree.jacobian(kinematics, self.end_effector) * servicer.nu;
        (
            Vector3::new(twist[0], twist[1], twist[2]),
            Vector3::new(twist[3], twist[4], twist[5]),
        )
    }

    /// Closes the gripper: from now on the target is welded to the end effector at its present relative pose. The impact is
    /// perfectly plastic and conserves momentum: with the Jacobian J of the target's frame,
    /// `(M + Jᵀ M_T J) ν⁺ = M ν⁻ + Jᵀ M_T v_T⁻`. Base, joints and pendulum all take part; no brake holds them.
    pub fn grasp(&mut self, motion: &mut Motion, target: &mut Target) -> Option<Grasp> {
        let servicer = &motion.servicer;
        let kinematics = self.kinematics(servicer);
        let p_e = self.tree.placement(&kinematics, self.end_effector);
        let (p_ne, r_ne) = (
            servicer.p_nb + servicer.quat_nb.rotate(&p_e.p),
            servicer.quat_nb.matrix() * p_e.r,
        );
        let held = Placement {
            p: r_ne.transpose() * (target.p_nb - p_ne),
            r: r_ne.transpose() * target.quat_nb.matrix(),
        };
        // J of the target's frame, target axes: rows [ω; v]
        let jacobian = self.tree.jacobian(&kinematics, self.end_effector);
        let (j_w, j_v) = (jacobian.fixed_rows::<3>(0), jacobian.fixed_rows::<3>(3));
        let back = held.r.transpose();
        let j_w_t = back * j_w;
        let j_v_t = back * (j_v - held.p.cross_matrix() * j_w);
        let (inertia, mass) = (self.target_inertia.about_com, self.target_inertia.mass);
        let before = self.mass_matrix(motion);
        let nu = self.velocities(motion);
        let (omega, v) = (target.omega(), target.velocity());
        let momentum: Generalised =
            before * nu + j_w_t.transpose() * (inertia * omega) + j_v_t.transpose() * (v * mass);
        let energy_before =
            0.5 * nu.dot(&(before * nu)) + 0.5 * omega.dot(&(inertia * omega)) + 0.5 * mass * v.norm_squared();

        self.weld_target(&held);
        let after = self.mass_matrix(motion);
        let nu = after.cholesky()?.solve(&momentum);
        self.set_velocities(motion, &nu);
        *target = self.held_target_motion(&motion.servicer, &held);
        Some(Grasp {
            held,
            loss: energy_before - 0.5 * nu.dot(&(after * nu)),
        })
    }

    /// Welds the target to the end effector at `held`, and changes no velocity.
    pub fn weld_target(&mut self, held: &Placement) {
        self.version = next_version();
        self.tree.attach(self.end_effector, held, &self.target_inertia);
        if let Some(spherical) = &mut self.spherical {
            spherical.attach(held, &self.target_inertia);
        }
    }

    /// All velocities: base, joints, and the pendulum's two.
    pub fn velocities(&self, motion: &Motion) -> Generalised {
        let mut nu = motion.servicer.nu;
        if self.spherical.is_some() {
            for (at, direction) in perpendicular_directions(&motion.bob.d).iter().enumerate() {
                nu[VELOCITIES - 2 + at] = direction.dot(&motion.bob.w);
            }
        }
        nu
    }

    /// Inverse of [`Model::velocities`]: writes the velocities into `motion`.
    pub fn set_velocities(&self, motion: &mut Motion, nu: &Generalised) {
        motion.servicer.nu = *nu;
        if self.spherical.is_some() {
            let [first, second] = perpendicular_directions(&motion.bob.d);
            motion.bob.w = first * nu[VELOCITIES - 2] + second * nu[VELOCITIES - 1];
            (motion.servicer.nu[VELOCITIES - 2], motion.servicer.nu[VELOCITIES - 1]) = (0.0, 0.0);
        }
    }

    /// The mass matrix for these velocities.
    pub fn mass_matrix(&self, motion: &Motion) -> SMatrix<f64, VELOCITIES, VELOCITIES> {
        match &self.spherical {
            None => self.tree.mass_matrix(&motion.servicer.q),
            Some(spherical) => spherical.mass_matrix(&motion.servicer, &motion.bob),
        }
    }
}

/// A version number not yet used in this process.
fn next_version() -> u64 {
    static VERSIONS: AtomicU64 = AtomicU64::new(0);
    VERSIONS.fetch_add(1, Ordering::Relaxed)
}

/// The quaternion of a rotation matrix.
pub fn quaternion_of(r: &Matrix3<f64>) -> Quaternion {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*r));
    Quaternion::from_wxyz([q.w, q.i, q.j, q.k]).normalized()
}
