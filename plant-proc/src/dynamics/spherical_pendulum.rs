//! The propellant as a spherical pendulum, without a singular bob position: [`multibody::SloshTree`].
//!
//! The servicer's state keeps its layout; its two hinge coordinates are zero, and the bob has a separate state. Where all velocities
//! are needed at once (the grasp, a brake) the last two are the bob's along two directions perpendicular to its rod.

use interfaces::{JOINTS, files};
use multibody::{
    Description, FrameId, Inertia, Joint, JointKind, Placement, SloshState, SloshTree, SphericalSlosh, State,
    from_two_hinges,
};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use serde::{Deserialize, Serialize};

use super::{Generalised, Servicer, VELOCITIES};

/// Number of velocities without the pendulum's.
const RIGID: usize = 6 + JOINTS;

/// The state of the bob.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(bound(
    serialize = "T: nalgebra::Scalar + Serialize",
    deserialize = "T: nalgebra::Scalar + Deserialize<'de>"
))]
pub struct Bob<T = f64> {
    /// Unit vector from hinge to bob, base axes; zero while the pendulum has hinges.
    pub d: Vector3<T>,
    /// Angular velocity of the pendulum relative to the base, perpendicular to `d`, base axes, rad/s.
    pub w: Vector3<T>,
}

impl Bob {
    /// No spherical pendulum.
    pub const NONE: Bob = Bob {
        d: Vector3::new(0.0, 0.0, 0.0),
        w: Vector3::new(0.0, 0.0, 0.0),
    };

    /// The bob's state for two hinges at these angles and rates.
    pub fn at(angles: [f64; 2], rates: [f64; 2]) -> Bob {
        let (d, w) = from_two_hinges(angles, rates);
        Bob { d, w }
    }

    /// Rotation from the hanging position as a rotation vector: its components about base y and x, rad.
    pub fn angles(&self) -> [f64; 2] {
        let axis = (-Vector3::z()).cross(&self.d);
        let size = axis.norm();
        if size == 0.0 {
            return [0.0; 2]; // hanging, or straight up, where no axis is special
        }
        let angle = libm::atan2(size, -self.d.z);
        [axis.y / size * angle, axis.x / size * angle]
    }
}

/// The servicer without the hinges, and the pendulum on its base.
#[derive(Debug, Clone)]
pub struct SphericalPendulum {
    tree: SloshTree<JOINTS, RIGID>,
    end_effector: FrameId,
}

impl SphericalPendulum {
    /// Replaces the two hinges of `description` by a spherical pendulum with the same bob.
    ///
    /// # Errors
    /// The property of the hinges that does not allow this.
    pub fn new(description: &Description, servicer: &files::Servicer) -> Result<Self, String> {
        let [first, second] = &servicer.slosh.joints;
        let joint = |name: &str| {
            let found = description.joints.iter().find(|joint| joint.name == name);
            found.ok_or_else(|| format!("the URDF has no joint `{name}`"))
        };
        let (y, x) = (joint(first)?, joint(second)?);
        let aligned = |joint: &Joint| (joint.origin.r - Matrix3::identity()).amax() < 1e-9;
        if (y.axis - Vector3::y()).amax() > 1e-9 || (x.axis - Vector3::x()).amax() > 1e-9 || !aligned(y) || !aligned(x)
        {
            return Err(format!("`{first}` must turn about base y and `{second}` about base x"));
        }
        if x.parent != y.child || x.origin.p.amax() > 1e-9 {
            return Err(format!("`{second}` must sit on `{first}`, in the same point"));
        }
        if (y.damping, y.stiffness) != (x.damping, x.stiffness) {
            return Err(format!(
                "`{first}` and `{second}` must have the same damping and stiffness"
            ));
        }
        let gimbal = &description.links[y.child];
        if gimbal.inertia.is_some_and(|inertia| inertia.mass != 0.0) {
            return Err(format!("`{}` must have no mass", gimbal.name));
        }
        let bob = description.links[x.child].inertia.ok_or("the bob has no inertia")?;
        if bob.com.x.abs() + bob.com.y.abs() > 1e-9 || bob.com.z >= 0.0 {
            return Err("the bob must hang along base -z".into());
        }
        let slosh = SphericalSlosh {
            hinge: hinge(description, y)?,
            mass: bob.mass,
            length: -bob.com.z,
            // the spherical pendulum has no inertia about its rod
            inertia: 0.5 * (bob.about_com.m11 + bob.about_com.m22),
            damping: y.damping,
            stiffness: y.stiffness,
            rest: -Vector3::z(),
        };
        let mut rest = description.clone();
        let name = gimbal.name.clone();
        rest.remove_branch(&name).map_err(|error| error.to_string())?;
        let tree = multibody::Tree::new(&rest).map_err(|error| error.to_string())?;
        let end_effector = tree
            .frame(&servicer.arm.end_effector)
            .map_err(|error| error.to_string())?;
        Ok(Self {
            tree: SloshTree::new(tree, slosh).map_err(|error| error.to_string())?,
            end_effector,
        })
    }

    /// The tree with its pendulum.
    pub fn tree(&self) -> &SloshTree<JOINTS, RIGID> {
        &self.tree
    }

    /// Welds a payload to the end effector.
    pub fn attach(&mut self, held: &Placement, inertia: &Inertia) {
        self.tree.attach(self.end_effector, held, inertia);
    }

    /// The state in the form of the tree.
    #[inline]
    pub fn state(&self, servicer: &Servicer, bob: &Bob) -> SloshState<JOINTS, RIGID> {
        SloshState {
            tree: State {
                p_nb: servicer.p_nb,
                quat_nb: servicer.quat_nb,
                q: servicer.q.fixed_rows::<JOINTS>(0).into(),
                nu: servicer.nu.fixed_rows::<RIGID>(0).into(),
            },
            d: bob.d,
            w: bob.w,
        }
    }

    /// Accelerations under `force`: of base and joints, and of the bob.
    pub fn accelerations(&self, servicer: &Servicer, bob: &Bob, force: &Generalised) -> (Generalised, Vector3<f64>) {
        let force: SVector<f64, RIGID> = force.fixed_rows::<RIGID>(0).into();
        let (nu, w) = self.tree.forward_dynamics(&self.state(servicer, bob), &force);
        let mut all = Generalised::zeros();
        all.fixed_rows_mut::<RIGID>(0).copy_from(&nu);
        (all, w)
    }

    /// Mass matrix of base, joints and the bob's two directions from [`perpendicular_directions`].
    pub fn mass_matrix(&self, servicer: &Servicer, bob: &Bob) -> SMatrix<f64, VELOCITIES, VELOCITIES> {
        let c = self.tree.slosh();
        let state = self.state(servicer, bob);
        let mut mass = SMatrix::<f64, VELOCITIES, VELOCITIES>::zeros();
        mass.fixed_view_mut::<RIGID, RIGID>(0, 0)
            .copy_from(&self.tree.tree().mass_matrix(&state.tree.q));
        // the bob's velocity is v + ω × (hinge + l d) + l w × d; its angular velocity perpendicular to the rod is ω − d d·ω + w
        let (mut speed, mut turn) = (
            SMatrix::<f64, 3, VELOCITIES>::zeros(),
            SMatrix::<f64, 3, VELOCITIES>::zeros(),
        );
        speed
            .fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&-(c.hinge + bob.d * c.length).cross_matrix());
        speed.fixed_view_mut::<3, 3>(0, 3).copy_from(&Matrix3::identity());
        turn.fixed_view_mut::<3, 3>(0, 0)
            .copy_from(&(Matrix3::identity() - bob.d * bob.d.transpose()));
        for (column, direction) in perpendicular_directions(&bob.d).iter().enumerate() {
            speed.set_column(RIGID + column, &(direction.cross(&bob.d) * c.length));
            turn.set_column(RIGID + column, direction);
        }
        mass + speed.transpose() * speed * c.mass + turn.transpose() * turn * c.inertia
    }
}

/// Two unit vectors perpendicular to `d` and to each other.
pub fn perpendicular_directions(d: &Vector3<f64>) -> [Vector3<f64>; 2] {
    // start from the base axis that is furthest from d, so that the product is never small
    let axis = d.iamin();
    let first = d.cross(&Vector3::ith(axis, 1.0)).normalize();
    [first, d.cross(&first)]
}

/// Position of the joint on the base: only fixed joints may lie between.
fn hinge(description: &Description, joint: &Joint) -> Result<Vector3<f64>, String> {
    let (mut place, mut link) = (joint.origin, joint.parent);
    while let Some(above) = description.joints.iter().find(|above| above.child == link) {
        if above.kind != JointKind::Fixed {
            return Err(format!(
                "`{}` must sit on the base, not behind `{}`",
                joint.name, above.name
            ));
        }
        (place, link) = (above.origin.then(&place), above.parent);
    }
    if (place.r - Matrix3::identity()).amax() > 1e-9 {
        return Err(format!("`{}` must be aligned with the base", joint.name));
    }
    Ok(place.p)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pendulum_angles_agree_with_hinges_and_rotation() {
        let small = Bob::at([0.02, -0.01], [0.0; 2]).angles();
        assert!(
            (small[0] - 0.02).abs() < 1e-5 && (small[1] + 0.01).abs() < 1e-5,
            "{small:?}"
        );
        // about one axis alone they are the same at any size
        for angle in [0.5, 2.0, 3.0] {
            let about_y = Bob::at([angle, 0.0], [0.0; 2]).angles();
            assert!((about_y[0] - angle).abs() < 1e-12 && about_y[1] == 0.0, "{about_y:?}");
        }
        assert_eq!(Bob::at([0.0; 2], [0.0; 2]).angles(), [0.0; 2]);
    }

    #[test]
    fn perpendicular_directions_are_orthonormal() {
        for d in [
            Vector3::x(),
            -Vector3::y(),
            Vector3::new(0.6, 0.0, -0.8),
            Vector3::new(1.0, 1.0, 1.0).normalize(),
        ] {
            let [a, b] = perpendicular_directions(&d);
            let worst = [a.dot(&b), a.dot(&d), b.dot(&d), a.norm() - 1.0, b.norm() - 1.0];
            assert!(worst.iter().all(|value| value.abs() < 1e-15), "{worst:?}");
        }
    }
}
