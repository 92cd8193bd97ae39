//! Conversion of links and joints to bodies: fixed joints merged, every moving axis rotated to +z, parents before children.

use super::mimic::JointCoupling;
use super::{Description, DescriptionError, Inertia, JointKind, Placement};
use nalgebra::{Matrix3, Vector3};

/// One moving body in the form that the kernels use. Its frame ("L") has its origin on the joint axis and +z along it; it
/// differs from the URDF link frame by the constant rotation kept in [`Merged::frames`].
#[derive(Clone, Debug)]
pub(crate) struct Body {
    pub name: String,
    pub joint: String,
    /// Index of the parent body, `None` for the base.
    pub parent: Option<usize>,
    /// Position of the joint among the moving joints of the file. That is its joint coordinate, unless there are ties.
    pub coordinate: usize,
    pub prismatic: bool,
    /// Pose of L in the parent's L (or in the base frame) at joint position zero.
    pub placement: Placement,
    pub inertia: Inertia,
    pub damping: f64,
    pub stiffness: f64,
    pub rest: f64,
    pub motor_inertia: f64,
}

/// A named frame on a body (`None`: the base), posed in that body's L frame.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    pub name: String,
    pub body: Option<usize>,
    pub placement: Placement,
}

/// The result of merging.
#[derive(Clone, Debug)]
pub(crate) struct Merged {
    pub base_name: String,
    pub base: Inertia,
    pub bodies: Vec<Body>,
    pub frames: Vec<Frame>,
    /// Source of each joint's position, by [`Body::coordinate`]; `None` when each has its own coordinate.
    pub couplings: Option<Vec<JointCoupling>>,
}

impl Merged {
    pub(crate) fn new(d: &Description) -> Result<Self, DescriptionError> {
        d.validate()?;
        let mut out = Self::of(d);
        out.couplings = d.joint_couplings()?;
        Ok(out)
    }

    /// The bodies of one tree of links, without a check of their masses.
    pub(super) fn of(d: &Description) -> Self {
        let root = d.root();
        let mut out = Self {
            base_name: d.links[root].name.clone(),
            base: Inertia::zero(),
            bodies: Vec::new(),
            frames: Vec::new(),
            couplings: None,
        };
        // For each link: its body, and its pose in that body's L frame.
        let mut place: Vec<Option<(Option<usize>, Placement)>> = vec![None; d.links.len()];
        place[root] = Some((None, Placement::identity()));
        out.add_link(d, root, None, Placement::identity());
        let coordinate = |joint: usize| d.joints[..joint].iter().filter(|j| j.kind != JointKind::Fixed).count();
        let mut waiting: Vec<usize> = (0..d.joints.len()).collect();
        // The file may list a child's joint before its parent's: repeatedly take the first joint with a placed parent. A file in
        // order keeps its order.
        while let Some(at) = waiting.iter().position(|&j| place[d.joints[j].parent].is_some()) {
            let index = waiting.remove(at);
            let j = &d.joints[index];
            let Some((parent, of_parent)) = place[j.parent] else {
                continue;
            };
            let origin = of_parent.then(&j.origin);
            let (body, of_link) = if j.kind == JointKind::Fixed {
                (parent, origin)
            } else {
                let to_z = frame_with_z_along(&j.axis.normalize());
                out.bodies.push(Body {
                    name: d.links[j.child].name.clone(),
                    joint: j.name.clone(),
                    parent,
                    coordinate: coordinate(index),
                    prismatic: j.kind == JointKind::Prismatic,
                    placement: Placement {
                        p: origin.p,
                        r: origin.r * to_z,
                    },
                    inertia: Inertia::zero(),
                    damping: j.damping,
                    stiffness: j.stiffness,
                    rest: j.rest,
                    motor_inertia: j.motor_inertia,
                });
                (
                    Some(out.bodies.len() - 1),
                    Placement {
                        p: Vector3::zeros(),
                        r: to_z.transpose(),
                    },
                )
            };
            place[j.child] = Some((body, of_link));
            out.add_link(d, j.child, body, of_link);
        }
        out
    }

    /// Adds link `link`, posed at `placement` on `body`, to that body's inertia and to the frames.
    fn add_link(&mut self, d: &Description, link: usize, body: Option<usize>, placement: Placement) {
        let link = &d.links[link];
        self.frames.push(Frame {
            name: link.name.clone(),
            body,
            placement,
        });
        if let Some(inertia) = &link.inertia {
            let target = match body {
                Some(b) => &mut self.bodies[b].inertia,
                None => &mut self.base,
            };
            *target = sum(target, &transformed(inertia, &placement));
        }
    }
}

/// The same body expressed in a frame in which its own frame has the pose `placement`.
pub(crate) fn transformed(i: &Inertia, placement: &Placement) -> Inertia {
    let about_com = placement.r * i.about_com * placement.r.transpose();
    Inertia {
        mass: i.mass,
        com: placement.p + placement.r * i.com,
        about_com: (about_com + about_com.transpose()) * 0.5,
    }
}

/// Two bodies welded together, both given in one frame.
fn sum(a: &Inertia, b: &Inertia) -> Inertia {
    let mass = a.mass + b.mass;
    if a.mass == 0.0 || b.mass == 0.0 {
        let com = if a.mass == 0.0 { b.com } else { a.com };
        return Inertia {
            mass,
            com,
            about_com: a.about_com + b.about_com,
        };
    }
    let com = (a.com * a.mass + b.com * b.mass) / mass;
    let about_com = a.about_com + b.about_com + steiner(a.mass, &(a.com - com)) + steiner(b.mass, &(b.com - com));
    Inertia { mass, com, about_com }
}

/// Inertia of a point mass at `d` about the origin.
pub(crate) fn steiner(mass: f64, d: &Vector3<f64>) -> Matrix3<f64> {
    (Matrix3::identity() * d.norm_squared() - d * d.transpose()) * mass
}

/// A rotation with the unit vector `z` as its third column. Axes along a coordinate axis give signed permutations,
/// without rounding.
fn frame_with_z_along(z: &Vector3<f64>) -> Matrix3<f64> {
    // start from the coordinate axis least aligned with z, so that the cross product is well conditioned
    let a = z.abs();
    let helper = if a.x <= a.y && a.x <= a.z {
        Vector3::x()
    } else if a.y <= a.z {
        Vector3::y()
    } else {
        Vector3::z()
    };
    let x = (helper - z * z.dot(&helper)).normalize();
    // a second pass: the first leaves a rounding error relative to the helper vector, not to the result
    let x = (x - z * z.dot(&x)).normalize();
    let y = z.cross(&x);
    Matrix3::from_columns(&[x, y, *z])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_with_z_along_an_axis_are_rotations() {
        for k in 0..2000 {
            let t = f64::from(k);
            let v = Vector3::new(libm::sin(t), libm::cos(2.3 * t) * 0.3, libm::sin(1.7 * t + 1.0)).normalize();
            let r = frame_with_z_along(&v);
            assert!((r.transpose() * r - Matrix3::identity()).amax() < 1.0e-15, "{v:?}");
            assert!((r.determinant() - 1.0).abs() < 1.0e-15);
        }
        for v in [Vector3::x(), -Vector3::y(), Vector3::z(), -Vector3::z()] {
            let r = frame_with_z_along(&v);
            assert_eq!(r.column(2), v);
            assert!(r.iter().all(|x| [-1.0, 0.0, 1.0].contains(x)), "{r}");
        }
    }
}
