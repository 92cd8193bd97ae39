//! The same algorithms on a tree of run-time size, for tools that accept arbitrary files.

use crate::description::{Description, Mimic};
use crate::kernel::jacobian::{frame_at, jacobian};
use crate::kernel::poses::{BodyPose, Rates, body_poses, rates};
use crate::kernel::{BASE, Model, aba, inertia, momentum, newton_euler};
use crate::num::{Dynamic, Real, V3, sin_cos};
use crate::reduction::CoordinateReduction;
use crate::rotation::Quaternion;
use crate::tree::{Constants, FrameId, TreeError, UnknownFrame, matrix, vector};
use crate::{Momentum, Placement};
use core::ops::{Index, IndexMut};
use nalgebra::Vector3;

/// A tree with any number of joints. Same code and same bits as [`Tree`](crate::Tree), with scratch space on the heap.
///
/// Joints may follow others ([`Mimic`]): the coordinates are then those of the independent joints, and every matrix and vector refers to
/// them. Without such joints nothing is different.
#[derive(Clone, Debug)]
pub struct DynTree {
    constants: Constants,
    mimics: Vec<Option<Mimic>>,
    floating: bool,
}

/// State of a [`DynTree`].
#[derive(Clone, Debug, PartialEq)]
pub struct DynState {
    /// Base origin in the world, `p_NB` (m).
    pub p_nb: Vector3<f64>,
    /// Attitude of the base, `quat_NB`.
    pub quat_nb: Quaternion,
    /// Joint coordinates.
    pub q: Vec<f64>,
    /// Generalised velocity: joint rates, on a floating base after `[ω_NB; v_NB]`.
    pub nu: Vec<f64>,
}

/// A matrix of run-time size, column by column.
#[derive(Clone, Debug, PartialEq)]
pub struct Dense {
    /// Number of rows.
    pub rows: usize,
    /// Number of columns.
    pub cols: usize,
    data: Vec<f64>,
}

impl Dense {
    fn zeros(rows: usize, cols: usize) -> Self {
        Self {
            rows,
            cols,
            data: vec![0.0; rows * cols],
        }
    }

    /// Solves a linear system with this symmetric positive definite matrix by elimination without pivoting.
    #[allow(clippy::needless_range_loop)] // the indices are those of the textbook
    fn solve(mut self, mut x: Vec<f64>) -> Vec<f64> {
        for k in 0..self.rows {
            for i in k + 1..self.rows {
                let factor = self[(i, k)] / self[(k, k)];
                x[i] -= factor * x[k];
                for j in k + 1..self.rows {
                    self[(i, j)] -= factor * self[(k, j)];
                }
            }
        }
        for k in (0..self.rows).rev() {
            let below: f64 = (k + 1..self.rows).map(|j| self[(k, j)] * x[j]).sum();
            x[k] = (x[k] - below) / self[(k, k)];
        }
        x
    }

    /// The rows, for printing.
    pub fn to_rows(&self) -> Vec<Vec<f64>> {
        (0..self.rows)
            .map(|r| (0..self.cols).map(|c| self[(r, c)]).collect())
            .collect()
    }
}

impl Index<(usize, usize)> for Dense {
    type Output = f64;
    fn index(&self, (r, c): (usize, usize)) -> &f64 {
        &self.data[c * self.rows + r]
    }
}

impl IndexMut<(usize, usize)> for Dense {
    fn index_mut(&mut self, (r, c): (usize, usize)) -> &mut f64 {
        &mut self.data[c * self.rows + r]
    }
}

/// One line of a tree's listing.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyInfo {
    /// Link after which the body is named; links fixed to it are merged into it.
    pub link: String,
    /// Joint that moves it, `None` for the base.
    pub joint: Option<String>,
    /// Whether that joint is prismatic.
    pub prismatic: bool,
    /// Name of the parent body's link.
    pub parent: Option<String>,
    /// Index of the joint coordinate; for a joint that follows another, that of the joint it follows.
    pub coordinate: Option<usize>,
    /// How the joint follows another, if it does.
    pub mimic: Option<Mimic>,
    /// Steps from the base.
    pub depth: usize,
    /// Mass, merged links included (kg).
    pub mass: f64,
    /// Damping of the joint.
    pub damping: f64,
    /// Motor inertia on the joint.
    pub motor_inertia: f64,
}

impl DynTree {
    /// Builds the tree on a floating or a fixed base; rejects the same mechanisms as [`Tree::new`](crate::Tree::new).
    pub fn new(description: &Description, floating: bool) -> Result<Self, TreeError> {
        let constants = Constants::new(description)?;
        check_inertia(&constants, floating)?;
        let joint = |name: &str| description.joints.iter().find(|joint| joint.name == name);
        let mimic = |(name, _): &(String, String)| joint(name).and_then(|joint| joint.mimic.clone());
        Ok(Self {
            mimics: constants.body_names.iter().map(mimic).collect(),
            constants,
            floating,
        })
    }

    fn reduction(&self) -> CoordinateReduction<'_> {
        CoordinateReduction {
            couplings: self.constants.couplings.as_deref(),
            offset: self.model().offset(),
        }
    }

    /// Number of velocities of all joints, followers included.
    fn full_dim(&self) -> usize {
        self.model().offset() + self.constants.bodies.len()
    }

    fn model(&self) -> Model<'_> {
        Model {
            base: &self.constants.base,
            bodies: &self.constants.bodies,
            floating: self.floating,
        }
    }

    fn poses(&self, s: &DynState) -> (Vec<BodyPose<f64>>, Vec<Rates<f64>>) {
        self.check(s);
        let poses = body_poses::<Dynamic, f64, _>(self.model(), &self.reduction().positions(&s.q));
        let rates = rates::<Dynamic, f64, _>(self.model(), &poses, &self.reduction().velocities(&s.nu));
        (poses, rates)
    }

    fn check(&self, s: &DynState) {
        assert_eq!(s.q.len(), self.joints(), "DynState::q has the wrong length");
        assert_eq!(s.nu.len(), self.dim(), "DynState::nu has the wrong length");
    }

    fn omega(&self, s: &DynState) -> V3<f64> {
        self.model().base_part(&s.nu).0
    }

    /// Number of joint coordinates.
    pub fn joints(&self) -> usize {
        self.reduction().coordinates(self.constants.bodies.len())
    }

    /// Number of velocity coordinates.
    pub fn dim(&self) -> usize {
        self.model().offset() + self.joints()
    }

    /// The bodies, base first, parents before children.
    pub fn bodies(&self) -> Vec<BodyInfo> {
        let c = &self.constants;
        let mut out = vec![BodyInfo {
            link: c.base_name.clone(),
            joint: None,
            prismatic: false,
            parent: None,
            coordinate: None,
            mimic: None,
            depth: 0,
            mass: c.base.mass,
            damping: 0.0,
            motor_inertia: 0.0,
        }];
        for (at, (b, (joint, link))) in c.bodies.iter().zip(&c.body_names).enumerate() {
            let above = b.parent;
            let coupling = c.couplings.as_ref().map(|couplings| couplings[b.coordinate].coordinate);
            out.push(BodyInfo {
                link: link.clone(),
                joint: Some(joint.clone()),
                prismatic: b.prismatic,
                parent: Some(out[above].link.clone()),
                coordinate: Some(coupling.unwrap_or(b.coordinate)),
                mimic: self.mimics[at].clone(),
                depth: out[above].depth + 1,
                mass: b.rigid.mass,
                damping: b.damping,
                motor_inertia: b.motor_inertia,
            });
        }
        out
    }

    /// Names of the frames: every link of the description.
    pub fn frame_names(&self) -> &[String] {
        &self.constants.frame_names
    }

    /// Names of the links that make up a body: the one it is named after and those fixed to it.
    pub fn frames_on(&self, body: &BodyInfo) -> Vec<&str> {
        let c = &self.constants;
        let place = c
            .body_names
            .iter()
            .position(|b| b.1 == body.link)
            .map_or(BASE, |i| i + 1);
        c.frames
            .iter()
            .zip(&c.frame_names)
            .filter(|(f, _)| f.body == place)
            .map(|(_, name)| name.as_str())
            .collect()
    }

    /// Finds a frame by the name of its link.
    pub fn frame(&self, name: &str) -> Result<FrameId, UnknownFrame> {
        self.constants.frame(name)
    }

    /// Mass matrix and Coriolis matrix.
    ///
    /// # Panics
    /// Here and below: if the state has the wrong number of coordinates.
    pub fn mass_and_coriolis(&self, s: &DynState) -> (Dense, Dense) {
        let (poses, rates) = self.poses(s);
        let full = self.full_dim();
        let (mut m, mut c) = (Dense::zeros(full, full), Dense::zeros(full, full));
        let omega = self.omega(s);
        inertia::mass_and_coriolis::<Dynamic, f64, true>(self.model(), &poses, &rates, omega, &mut m.data, &mut c.data);
        let reduced = |full: Dense| Dense {
            rows: self.dim(),
            cols: self.dim(),
            data: self.reduction().congruence(full.data),
        };
        (reduced(m), reduced(c))
    }

    /// The bias force C ν.
    pub fn bias(&self, s: &DynState) -> Vec<f64> {
        self.rnea(s, &vec![0.0; self.dim()])
    }

    /// Inverse dynamics `M a + C ν`, without gravity, dampers and springs.
    pub fn rnea(&self, s: &DynState, a: &[f64]) -> Vec<f64> {
        self.check(s);
        assert_eq!(a.len(), self.dim(), "the acceleration has the wrong length");
        let mut out = vec![0.0; self.full_dim()];
        let zero = V3::zero();
        let reduction = self.reduction();
        let (q, nu, a) = (
            reduction.positions(&s.q),
            reduction.velocities(&s.nu),
            reduction.velocities(a),
        );
        newton_euler::newton_euler::<Dynamic, f64, true>(self.model(), &q, &nu, &a, &nu, zero, &mut out);
        reduction.rows(out)
    }

    /// `M a + C(ν) ν_r` in one pass.
    pub fn mass_coriolis_product(&self, s: &DynState, a: &[f64], nu_r: &[f64]) -> Vec<f64> {
        self.check(s);
        assert_eq!(
            (a.len(), nu_r.len()),
            (self.dim(), self.dim()),
            "a and ν_r have the wrong length"
        );
        let mut out = vec![0.0; self.full_dim()];
        let zero = V3::zero();
        let reduction = self.reduction();
        let (q, nu) = (reduction.positions(&s.q), reduction.velocities(&s.nu));
        let (a, nu_r) = (reduction.velocities(a), reduction.velocities(nu_r));
        newton_euler::newton_euler::<Dynamic, f64, false>(self.model(), &q, &nu, &a, &nu_r, zero, &mut out);
        reduction.rows(out)
    }

    /// Mass matrix over any scalar, column by column.
    pub fn mass_matrix_in<T: Real>(&self, q: &[T]) -> Vec<T> {
        let poses = body_poses::<Dynamic, T, _>(self.model(), &self.reduction().positions(q));
        let mut m = vec![T::of(0.0); self.full_dim() * self.full_dim()];
        let (model, rest) = (self.model(), V3::zero());
        inertia::mass_and_coriolis::<Dynamic, T, false>(model, &poses, &[], rest, &mut m, &mut []);
        self.reduction().congruence(m)
    }

    /// Body Jacobian of a frame over any scalar, column by column; it depends on the joints alone.
    pub fn jacobian_in<T: Real>(&self, q: &[T], frame: FrameId) -> Vec<T> {
        let poses = body_poses::<Dynamic, T, _>(self.model(), &self.reduction().positions(q));
        let rest = vec![T::of(0.0); self.full_dim()];
        let rates = rates::<Dynamic, T, _>(self.model(), &poses, &rest);
        let mut j = vec![T::of(0.0); 6 * self.full_dim()];
        let frame = &self.constants.frames[frame.0];
        jacobian::<T, f64, false>(self.model(), &poses, &rates, V3::zero(), frame, &mut j);
        self.reduction().columns(6, j)
    }

    /// Pose of a frame in the base over any scalar: (`p_BE`, columns of `R_BE`).
    pub fn placement_in<T: Real>(&self, q: &[T], frame: FrameId) -> ([T; 3], [[T; 3]; 3]) {
        let poses = body_poses::<Dynamic, T, _>(self.model(), &self.reduction().positions(q));
        let rest = vec![T::of(0.0); self.full_dim()];
        let rates = rates::<Dynamic, T, _>(self.model(), &poses, &rest);
        let (r, p) = frame_at(&self.constants.frames[frame.0], &poses, &rates);
        (p.to_array(), r.c.map(V3::to_array))
    }

    /// Forward dynamics without gravity, with dampers and springs.
    pub fn forward_dynamics(&self, s: &DynState, tau: &[f64]) -> Vec<f64> {
        self.check(s);
        assert_eq!(tau.len(), self.dim(), "the generalised force has the wrong length");
        if self.constants.couplings.is_some() {
            return self.reduced_forward_dynamics(s, tau);
        }
        let mut out = vec![0.0; self.dim()];
        aba::aba::<Dynamic, f64, _>(self.model(), &s.q, &s.nu, tau, V3::zero(), None, &mut out);
        out
    }

    /// `Gᵀ M G a = τ + Gᵀ (−D q̇ − K (q − q₀)) − Gᵀ C ν`.
    fn reduced_forward_dynamics(&self, s: &DynState, tau: &[f64]) -> Vec<f64> {
        let reduction = self.reduction();
        let (q, nu) = (reduction.positions(&s.q), reduction.velocities(&s.nu));
        let mut passive = vec![0.0; self.full_dim()];
        for link in &self.constants.bodies {
            let row = reduction.offset + link.coordinate;
            passive[row] = -link.damping * nu[row] - link.stiffness * (q[link.coordinate] - link.rest);
        }
        let (mass, _) = self.mass_and_coriolis(s);
        let force = reduction.rows(passive).into_iter().zip(tau).zip(self.bias(s));
        mass.solve(force.map(|((passive, tau), bias)| tau + passive - bias).collect())
    }

    /// Pose of a frame in the world.
    pub fn placement_in_world(&self, s: &DynState, frame: FrameId) -> Placement {
        let (poses, rates) = self.poses(s);
        let (r, p) = frame_at(&self.constants.frames[frame.0], &poses, &rates);
        let base = Placement {
            p: s.p_nb,
            r: s.quat_nb.matrix(),
        };
        base.then(&Placement {
            p: vector(p),
            r: matrix(&r),
        })
    }

    /// Body Jacobian of a frame (rows [ω; v] in its axes) and its time derivative.
    pub fn jacobian_and_rate(&self, s: &DynState, frame: FrameId) -> (Dense, Dense) {
        let (poses, rates) = self.poses(s);
        let (mut j, mut rate) = (Dense::zeros(6, self.full_dim()), Dense::zeros(6, self.full_dim()));
        let frame = &self.constants.frames[frame.0];
        let omega = self.omega(s);
        jacobian::<f64, f64, false>(self.model(), &poses, &rates, omega, frame, &mut j.data);
        jacobian::<f64, f64, true>(self.model(), &poses, &rates, omega, frame, &mut rate.data);
        let reduced = |full: Dense| Dense {
            rows: 6,
            cols: self.dim(),
            data: self.reduction().columns(6, full.data),
        };
        (reduced(j), reduced(rate))
    }

    /// Mass, centre of mass and momentum in B axes.
    pub fn momentum(&self, s: &DynState) -> Momentum {
        Momentum::of(&self.sums(s), self.model().base_part(&s.nu).1)
    }

    /// Mass, centre of mass and momentum of each body in B axes, in the order of [`DynTree::bodies`]; the angular momentum is
    /// about the body's own centre of mass. For a massless body the origin stands for the centre of mass.
    pub fn body_momenta(&self, s: &DynState) -> Vec<Momentum> {
        let (poses, rates) = self.poses(s);
        let v = self.model().base_part(&s.nu).1;
        let each = momentum::each(self.model(), &poses, &rates);
        each.zip(&rates)
            .map(|(sums, rate)| match sums.mass > 0.0 {
                true => Momentum::of(&sums, v),
                false => Momentum {
                    mass: 0.0,
                    p_bc: vector(rate.p),
                    linear_b: Vector3::zeros(),
                    angular_b: vector(sums.l),
                },
            })
            .collect()
    }

    /// Kinetic energy (J).
    pub fn kinetic_energy(&self, s: &DynState) -> f64 {
        self.sums(s).energy_at(self.model().base_part(&s.nu).1)
    }

    fn sums(&self, s: &DynState) -> momentum::Sums<f64> {
        let (poses, rates) = self.poses(s);
        momentum::sums(self.model(), &poses, &rates, &self.reduction().velocities(&s.nu))
    }
}

/// Rejects a mechanism in which some pivot of the factorised mass matrix (the articulated-body algorithm divides by
/// the same numbers) vanishes at each of a few generic configurations: such a part has no inertia in any configuration.
/// (A pivot that vanishes only at special configurations, such as a point bob's in line with its first hinge, cannot be
/// detected here.)
pub(crate) fn check_inertia(c: &Constants, floating: bool) -> Result<(), TreeError> {
    const VANISHED: f64 = 1.0e-12;
    let tree = DynTree {
        constants: c.clone(),
        mimics: Vec::new(),
        floating,
    };
    let (n, offset) = (tree.joints(), tree.model().offset());
    let mut best = vec![0.0_f64; tree.dim()];
    // the coordinate of a joint that follows no other
    let independent_coordinate = |joint: usize| match &c.couplings {
        None => Some(joint),
        Some(couplings) => couplings[joint].independent.then_some(couplings[joint].coordinate),
    };
    for trial in 0..3 {
        let q = (0..n)
            .map(|i| 3.0 * sin_cos(1.0 + 2.4 * i as f64 + 1.1 * f64::from(trial)).0)
            .collect();
        let state = DynState {
            p_nb: Vector3::zeros(),
            quat_nb: Quaternion::IDENTITY,
            q,
            nu: vec![0.0; tree.dim()],
        };
        let (mut m, _) = tree.mass_and_coriolis(&state);
        let original_diagonal: Vec<f64> = (0..tree.dim()).map(|k| m[(k, k)]).collect();
        // leaves first, base last: the elimination order of the recursion
        let joints = c
            .bodies
            .iter()
            .rev()
            .filter_map(|b| independent_coordinate(b.coordinate))
            .map(|k| offset + k);
        let order: Vec<usize> = joints.chain((0..offset).rev()).collect();
        for (at, &k) in order.iter().enumerate() {
            let ratio = m[(k, k)] / original_diagonal[k];
            if ratio.is_nan() || ratio <= VANISHED {
                continue; // dividing by it would put the blame on everything below
            }
            best[k] = best[k].max(ratio);
            for &i in &order[at + 1..] {
                let factor = m[(i, k)] / m[(k, k)];
                for &j in &order[at + 1..] {
                    m[(i, j)] -= factor * m[(k, j)];
                }
            }
        }
    }
    for (b, (joint, link)) in c.bodies.iter().zip(&c.body_names) {
        if independent_coordinate(b.coordinate).is_some_and(|k| best[offset + k] <= VANISHED) {
            return Err(TreeError::NoInertia {
                what: format!("joint `{joint}` (link `{link}`)"),
                remedy: "give the link mass or inertia, give the joint motor inertia, or make the joint fixed",
            });
        }
    }
    if best[..offset].iter().any(|b| *b <= VANISHED) {
        return Err(TreeError::NoInertia {
            what: format!("the floating base (link `{}`)", c.base_name),
            remedy: "give the root link an <inertial> with mass and inertia, or fix the base",
        });
    }
    Ok(())
}
