//! The same algorithms on a tree whose size is only known at run time: for tools that are handed any file.

use crate::description::Description;
use crate::kernel::jacobian::{frame_at, jacobian};
use crate::kernel::place::{Placed, Rates, place, rates};
use crate::kernel::{BASE, Model, aba, inertia, momentum, newton_euler};
use crate::num::{Dynamic, Real, V3, sin_cos};
use crate::rotation::Quaternion;
use crate::tree::{Constants, FrameId, TreeError, UnknownFrame, matrix, vector};
use crate::{Momentum, Placement};
use core::ops::{Index, IndexMut};
use nalgebra::Vector3;

/// A tree of any number of joints. Same code and same bits as [`Tree`](crate::Tree), with scratch space on the heap.
#[derive(Clone, Debug)]
pub struct DynTree {
    constants: Constants,
    floating: bool,
}

/// State of a [`DynTree`].
#[derive(Clone, Debug, PartialEq)]
pub struct DynState {
    /// Base origin in the world, `p_NB` (m).
    pub p_nb: Vector3<f64>,
    /// Attitude of the base, `quat_NB`.
    pub quat_nb: Quaternion,
    /// Joint positions.
    pub q: Vec<f64>,
    /// Generalised velocity: joint rates, on a floating base after `[ω_NB; v_NB]`.
    pub nu: Vec<f64>,
}

/// A matrix whose size is known at run time, column by column.
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
    /// Link that gives the body its name; links fixed to it are merged into it.
    pub link: String,
    /// Joint that moves it, `None` for the base.
    pub joint: Option<String>,
    /// Whether that joint slides.
    pub prismatic: bool,
    /// Name of the parent body's link.
    pub parent: Option<String>,
    /// Index of the joint coordinate.
    pub coordinate: Option<usize>,
    /// Steps from the base.
    pub depth: usize,
    /// Mass with everything merged (kg).
    pub mass: f64,
    /// Damping of the joint.
    pub damping: f64,
    /// Motor inertia on the joint.
    pub motor_inertia: f64,
}

impl DynTree {
    /// Builds the tree on a floating or a fixed base; refuses what [`Tree::new`](crate::Tree::new) refuses.
    pub fn new(description: &Description, floating: bool) -> Result<Self, TreeError> {
        let constants = Constants::new(description)?;
        check_inertia(&constants, floating)?;
        Ok(Self { constants, floating })
    }

    fn model(&self) -> Model<'_> {
        Model {
            base: &self.constants.base,
            bodies: &self.constants.bodies,
            floating: self.floating,
        }
    }

    fn placed(&self, s: &DynState) -> (Vec<Placed<f64>>, Vec<Rates<f64>>) {
        self.check(s);
        let placed = place::<Dynamic, f64>(self.model(), &s.q);
        let rates = rates::<Dynamic, f64>(self.model(), &placed, &s.nu);
        (placed, rates)
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
        self.constants.bodies.len()
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
            depth: 0,
            mass: c.base.mass,
            damping: 0.0,
            motor_inertia: 0.0,
        }];
        for (b, (joint, link)) in c.bodies.iter().zip(&c.body_names) {
            let above = b.parent;
            out.push(BodyInfo {
                link: link.clone(),
                joint: Some(joint.clone()),
                prismatic: b.prismatic,
                parent: Some(out[above].link.clone()),
                coordinate: Some(b.coordinate),
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
        let (placed, rates) = self.placed(s);
        let dim = self.dim();
        let (mut m, mut c) = (Dense::zeros(dim, dim), Dense::zeros(dim, dim));
        let omega = self.omega(s);
        inertia::mass_and_coriolis::<Dynamic, f64, true>(
            self.model(),
            &placed,
            &rates,
            omega,
            &mut m.data,
            &mut c.data,
        );
        (m, c)
    }

    /// The bias force C ν.
    pub fn bias(&self, s: &DynState) -> Vec<f64> {
        self.rnea(s, &vec![0.0; self.dim()])
    }

    /// Inverse dynamics `M a + C ν`, without gravity, dampers and springs.
    pub fn rnea(&self, s: &DynState, a: &[f64]) -> Vec<f64> {
        self.check(s);
        assert_eq!(a.len(), self.dim(), "the acceleration has the wrong length");
        let mut out = vec![0.0; self.dim()];
        let zero = V3::zero();
        newton_euler::newton_euler::<Dynamic, f64, true>(self.model(), &s.q, &s.nu, a, &s.nu, zero, &mut out);
        out
    }

    /// `M a + C(ν) ν_r` in one pass.
    pub fn mass_coriolis_product(&self, s: &DynState, a: &[f64], nu_r: &[f64]) -> Vec<f64> {
        self.check(s);
        assert_eq!(
            (a.len(), nu_r.len()),
            (self.dim(), self.dim()),
            "a and ν_r have the wrong length"
        );
        let mut out = vec![0.0; self.dim()];
        let zero = V3::zero();
        newton_euler::newton_euler::<Dynamic, f64, false>(self.model(), &s.q, &s.nu, a, nu_r, zero, &mut out);
        out
    }

    /// Mass matrix over any scalar, column by column.
    pub fn mass_matrix_in<T: Real>(&self, q: &[T]) -> Vec<T> {
        let placed = place::<Dynamic, T>(self.model(), q);
        let mut m = vec![T::of(0.0); self.dim() * self.dim()];
        let (model, rest) = (self.model(), V3::zero());
        inertia::mass_and_coriolis::<Dynamic, T, false>(model, &placed, &[], rest, &mut m, &mut []);
        m
    }

    /// Body Jacobian of a frame over any scalar, column by column; it depends on the joints alone.
    pub fn jacobian_in<T: Real>(&self, q: &[T], frame: FrameId) -> Vec<T> {
        let placed = place::<Dynamic, T>(self.model(), q);
        let rest = vec![T::of(0.0); self.dim()];
        let rates = rates::<Dynamic, T>(self.model(), &placed, &rest);
        let mut j = vec![T::of(0.0); 6 * self.dim()];
        let frame = &self.constants.frames[frame.0];
        jacobian::<T, false>(self.model(), &placed, &rates, V3::zero(), frame, &mut j);
        j
    }

    /// Pose of a frame in the base over any scalar: (`p_BE`, columns of `R_BE`).
    pub fn placement_in<T: Real>(&self, q: &[T], frame: FrameId) -> ([T; 3], [[T; 3]; 3]) {
        let placed = place::<Dynamic, T>(self.model(), q);
        let rest = vec![T::of(0.0); self.dim()];
        let rates = rates::<Dynamic, T>(self.model(), &placed, &rest);
        let (r, p) = frame_at(&self.constants.frames[frame.0], &placed, &rates);
        (p.to_array(), r.c.map(V3::to_array))
    }

    /// Forward dynamics without gravity, with dampers and springs.
    pub fn forward_dynamics(&self, s: &DynState, tau: &[f64]) -> Vec<f64> {
        self.check(s);
        assert_eq!(tau.len(), self.dim(), "the generalised force has the wrong length");
        let mut out = vec![0.0; self.dim()];
        aba::aba::<Dynamic, f64>(self.model(), &s.q, &s.nu, tau, V3::zero(), None, &mut out);
        out
    }

    /// Pose of a frame in the world.
    pub fn placement_in_world(&self, s: &DynState, frame: FrameId) -> Placement {
        let (placed, rates) = self.placed(s);
        let (r, p) = frame_at(&self.constants.frames[frame.0], &placed, &rates);
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
        let (placed, rates) = self.placed(s);
        let (mut j, mut rate) = (Dense::zeros(6, self.dim()), Dense::zeros(6, self.dim()));
        let frame = &self.constants.frames[frame.0];
        let omega = self.omega(s);
        jacobian::<f64, false>(self.model(), &placed, &rates, omega, frame, &mut j.data);
        jacobian::<f64, true>(self.model(), &placed, &rates, omega, frame, &mut rate.data);
        (j, rate)
    }

    /// Mass, centre of mass and momentum in B axes.
    pub fn momentum(&self, s: &DynState) -> Momentum {
        Momentum::of(&self.sums(s), self.model().base_part(&s.nu).1)
    }

    /// Mass, centre of mass and momentum of each body in B axes, in the order of [`DynTree::bodies`]; the angular momentum is
    /// about the body's own centre of mass. A body without mass has its origin for a centre of mass.
    pub fn body_momenta(&self, s: &DynState) -> Vec<Momentum> {
        let (placed, rates) = self.placed(s);
        let v = self.model().base_part(&s.nu).1;
        let each = momentum::each(self.model(), &placed, &rates);
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
        let (placed, rates) = self.placed(s);
        momentum::sums(self.model(), &placed, &rates, &s.nu)
    }
}

/// Refuses a mechanism in which some pivot of the factorised mass matrix (the articulated-body algorithm divides by
/// the same numbers) vanishes at each of a few generic configurations: such a part has no inertia to accelerate,
/// whatever the configuration. (A pivot that vanishes only at special configurations, as a point bob's does in line with
/// its first hinge, cannot be refused here.)
pub(crate) fn check_inertia(c: &Constants, floating: bool) -> Result<(), TreeError> {
    const VANISHED: f64 = 1.0e-12;
    let tree = DynTree {
        constants: c.clone(),
        floating,
    };
    let (n, offset) = (tree.joints(), tree.model().offset());
    let mut best = vec![0.0_f64; tree.dim()];
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
        let whole: Vec<f64> = (0..tree.dim()).map(|k| m[(k, k)]).collect();
        // leaves first, base last: the order in which the recursion eliminates
        let joints = c.bodies.iter().rev().map(|b| offset + b.coordinate);
        let order: Vec<usize> = joints.chain((0..offset).rev()).collect();
        for (at, &k) in order.iter().enumerate() {
            let ratio = m[(k, k)] / whole[k];
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
        if best[offset + b.coordinate] <= VANISHED {
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
