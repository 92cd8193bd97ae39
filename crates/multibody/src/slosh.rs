//! Propellant slosh as a spherical pendulum without a singular position.
//!
//! The paper's pendulum (Eq 2) is two hinges at right angles with a massless body between them. Where the bob lies along
//! the first hinge that pair cannot move it sideways: the hinge rates grow without bound as the bob passes by, and
//! without gravity nothing keeps it away. Here the bob's direction is a unit vector `d` instead, and its rate a vector
//! `w ⟂ d`, so that no direction is special: a ball joint with the spin taken out. The bob has no inertia about `d` (a
//! spin would have nothing to drive it).
//!
//! With ω the base's angular velocity, ρ the hinge, a_h the hinge's acceleration, J = m l² + i, τ the torque of damper
//! and spring on the bob, everything in base axes and rates inertial:
//!
//! * ḋ = (ω + w) × d, and the angular momentum about the hinge gives J (d × d̈) = −m l d × a_h + τ;
//! * so the base feels the force −m (a_h + l d̈), which is an articulated inertia without a joint to eliminate:
//!   `f = m [(1 − κ) 1 + κ d dᵀ] a_h + (m l/J) τ × d − m l |ḋ|² d`, κ = m l²/J, and the torque −τ.
//!
//! The tree's forward dynamics includes this as a load on its base, and the pendulum's acceleration follows from a_h.

use crate::description::{Inertia, Placement};
use crate::integrate::{OdeSystem, Rate};
use crate::kernel::aba::Articulated;
use crate::num::{Sym3, V3};
use crate::state::State;
use crate::tree::{FrameId, Momentum, Tree};
use nalgebra::{SVector, Vector3};

/// The pendulum's constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphericalSlosh {
    /// Hinge from the base origin, `p_BH` (B axes, m).
    pub hinge: Vector3<f64>,
    /// Mass of the bob (kg).
    pub mass: f64,
    /// Hinge to bob (m).
    pub length: f64,
    /// The bob's own inertia about its centre, across the rod (kg m²).
    pub inertia: f64,
    /// Viscous damping β (N m s/rad): torque −β w.
    pub damping: f64,
    /// Stiffness k of a restoring torque `k d × rest` (N m/rad), from surface tension; its energy is k (1 − d·rest).
    pub stiffness: f64,
    /// Direction of the bob at which that torque vanishes (unit vector, B axes).
    pub rest: Vector3<f64>,
}

/// Errors of the pendulum's parameters.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("slosh pendulum: {what} is {value}; {remedy}")]
pub struct SloshError {
    what: &'static str,
    value: f64,
    remedy: &'static str,
}

/// A tree with the pendulum on its base.
#[derive(Clone, Debug)]
pub struct SloshTree<const N: usize, const V: usize> {
    tree: Tree<N, V>,
    slosh: SphericalSlosh,
}

/// State of a [`SloshTree`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SloshState<const N: usize, const V: usize> {
    /// The tree's state.
    pub tree: State<N, V>,
    /// Unit vector from hinge to bob (B axes).
    pub d: Vector3<f64>,
    /// Angular velocity of the pendulum relative to the base, perpendicular to `d` (B axes, rad/s): `d` moves at `w × d`
    /// as seen from the base.
    pub w: Vector3<f64>,
}

/// Rates of the coordinates of a [`SloshState`].
#[derive(Clone, Copy, Debug)]
pub struct SloshRate<const N: usize, const V: usize> {
    tree: Rate<N, V>,
    d: Vector3<f64>,
    w: Vector3<f64>,
}

impl SphericalSlosh {
    fn check(&self) -> Result<(), SloshError> {
        let bad = |what, value, remedy| Err(SloshError { what, value, remedy });
        for (what, x) in [("the mass", self.mass), ("the length", self.length)] {
            if !(x > 0.0 && x.is_finite()) {
                return bad(what, x, "give a positive number");
            }
        }
        let others = [
            ("the bob inertia", self.inertia),
            ("the damping", self.damping),
            ("the stiffness", self.stiffness),
        ];
        for (what, x) in others {
            if !(x >= 0.0 && x.is_finite()) {
                return bad(what, x, "give a number, zero or more");
            }
        }
        let length = self.rest.norm();
        if (length - 1.0).abs() > 1e-9 {
            return bad("the length of the rest direction", length, "give a unit vector");
        }
        Ok(())
    }

    /// Inertia about the hinge (kg m²).
    fn about_hinge(&self) -> f64 {
        self.mass * self.length * self.length + self.inertia
    }

    /// Torque of damper and spring on the bob.
    fn torque(&self, d: &Vector3<f64>, w: &Vector3<f64>) -> Vector3<f64> {
        w * -self.damping + d.cross(&self.rest) * self.stiffness
    }
}

/// Direction and rate of the bob of the paper's two-hinge pendulum (first hinge along y, second along x, bob below at
/// zero) at hinge angles `q` and rates `rates`.
pub fn from_two_hinges(q: [f64; 2], rates: [f64; 2]) -> (Vector3<f64>, Vector3<f64>) {
    let ((s1, c1), (s2, c2)) = (crate::sin_cos(q[0]), crate::sin_cos(q[1]));
    let d = Vector3::new(-c2 * s1, s2, -c2 * c1);
    let turn = Vector3::y() * rates[0] + Vector3::new(c1, 0.0, -s1) * rates[1];
    (d, turn - d * d.dot(&turn))
}

impl<const N: usize, const V: usize> SloshTree<N, V> {
    /// Attaches `slosh` to the base of `tree`, which must be floating and must not already contain that mass.
    pub fn new(tree: Tree<N, V>, slosh: SphericalSlosh) -> Result<Self, SloshError> {
        const { assert!(V == N + 6, "the slosh pendulum hangs on a floating base") };
        slosh.check()?;
        Ok(Self { tree, slosh })
    }

    /// The tree without the pendulum.
    pub fn tree(&self) -> &Tree<N, V> {
        &self.tree
    }

    /// Welds a payload to a frame of the tree, as [`Tree::attach`].
    pub fn attach(&mut self, frame: FrameId, payload: &Placement, inertia: &Inertia) {
        self.tree.attach(frame, payload, inertia);
    }

    /// The pendulum.
    pub fn slosh(&self) -> &SphericalSlosh {
        &self.slosh
    }

    /// Accelerations under the generalised force `tau` on the tree: ν̇, and the rate of `w` (B axes).
    pub fn forward_dynamics(&self, s: &SloshState<N, V>, tau: &SVector<f64, V>) -> (SVector<f64, V>, Vector3<f64>) {
        let c = &self.slosh;
        let (d, w, omega, v) = (s.d, s.w, s.tree.omega(), s.tree.velocity());
        let j = c.about_hinge();
        let torque = c.torque(&d, &w);
        let across = omega - d * d.dot(&omega) + w; // d × ḋ
        let d_rate = across.cross(&d);
        let spin = omega.cross(&omega.cross(&c.hinge));

        let kappa = c.mass * c.length * c.length / j;
        let (iso, along) = (c.mass * (1.0 - kappa), c.mass * kappa);
        let effective = |a: &Vector3<f64>| a * iso + d * (along * d.dot(a));
        let force = torque.cross(&d) * (c.mass * c.length / j) - d * (c.mass * c.length * d_rate.norm_squared())
            + effective(&spin);
        let pack = |v: &Vector3<f64>| V3::new(v.x, v.y, v.z);
        let mut load = Articulated::zero();
        let own = Articulated {
            m: Sym3::scalar(iso).add_outer(pack(&d), pack(&(d * along))),
            n: pack(&torque),
            f: pack(&force),
            ..Articulated::zero()
        };
        load.add_shifted(&own, pack(&c.hinge));

        let g = s.tree.quat_nb.rotate_back(&self.tree.gravity);
        let mut nu_dot = SVector::zeros();
        let (q, nu, tau) = (&s.tree.q.data.0[0], &s.tree.nu.data.0[0], &tau.data.0[0]);
        self.tree
            .aba_into::<f64>(q, nu, tau, pack(&g), Some(&load), &mut nu_dot.data.0[0]);

        let alpha = Vector3::new(nu_dot[0], nu_dot[1], nu_dot[2]);
        let acc = Vector3::new(nu_dot[3], nu_dot[4], nu_dot[5]) + omega.cross(&v) - g;
        let a_h = acc + alpha.cross(&c.hinge) + spin;
        let turn = (torque - d.cross(&a_h) * (c.mass * c.length)) / j; // d × d̈
        // w = across − (ω − d d·ω), differentiated in base axes, where d moves at w × d
        let d_seen = w.cross(&d);
        let w_rate =
            turn - omega.cross(&across) - alpha + d_seen * d.dot(&omega) + d * (d_seen.dot(&omega) + d.dot(&alpha));
        (nu_dot, w_rate)
    }

    /// Momentum of tree and pendulum together, B axes.
    pub fn momentum(&self, s: &SloshState<N, V>) -> Momentum {
        self.momentum_and_energy(s).0
    }

    /// Kinetic energy of tree and pendulum (J).
    pub fn kinetic_energy(&self, s: &SloshState<N, V>) -> f64 {
        self.momentum_and_energy(s).1
    }

    /// Momentum and kinetic energy in one pass.
    pub fn momentum_and_energy(&self, s: &SloshState<N, V>) -> (Momentum, f64) {
        let c = &self.slosh;
        let kinematics = self.tree.kinematics(&s.tree.q, &s.tree.nu);
        let (m, energy) = self.tree.momentum_and_energy(&kinematics);
        let (p, v, across) = self.bob(s);
        let mass = m.mass + c.mass;
        let p_bc = (m.p_bc * m.mass + p * c.mass) / mass;
        let v_tree = m.linear_b / m.mass;
        let linear_b = m.linear_b + v * c.mass;
        let reduced = m.mass * c.mass / mass;
        let angular_b = m.angular_b + across * c.inertia + (p - m.p_bc).cross(&(v - v_tree)) * reduced;
        let momentum = Momentum {
            mass,
            p_bc,
            linear_b,
            angular_b,
        };
        let energy = energy + 0.5 * c.mass * v.norm_squared() + 0.5 * c.inertia * across.norm_squared();
        (momentum, energy)
    }

    /// Energy of the tree's springs and gravity and of the pendulum's spring (J).
    pub fn potential_energy(&self, s: &SloshState<N, V>) -> f64 {
        let (p, ..) = self.bob(s);
        let at = s.tree.p_nb + s.tree.quat_nb.rotate(&p);
        self.tree.potential_energy(&s.tree) - self.slosh.mass * self.tree.gravity.dot(&at)
            + self.slosh.stiffness * (1.0 - s.d.dot(&self.slosh.rest))
    }

    /// Power of the tree's and the pendulum's dampers (W, never positive).
    pub fn damper_power(&self, s: &SloshState<N, V>) -> f64 {
        self.tree.damper_power(&s.tree.nu) - self.slosh.damping * s.w.norm_squared()
    }

    /// The bob: position from the base origin, inertial velocity, inertial angular velocity across the rod; B axes.
    fn bob(&self, s: &SloshState<N, V>) -> (Vector3<f64>, Vector3<f64>, Vector3<f64>) {
        let (omega, c) = (s.tree.omega(), &self.slosh);
        let across = omega - s.d * s.d.dot(&omega) + s.w;
        let v = s.tree.velocity() + omega.cross(&c.hinge) + across.cross(&s.d) * c.length;
        (c.hinge + s.d * c.length, v, across)
    }
}

impl<const N: usize, const V: usize> OdeSystem for SloshTree<N, V> {
    type State = SloshState<N, V>;
    type Rate = SloshRate<N, V>;
    type Force = SVector<f64, V>;

    fn rate(&self, s: &Self::State, tau: &Self::Force) -> Self::Rate {
        let (nu, w) = self.forward_dynamics(s, tau);
        SloshRate {
            tree: Rate::of(&s.tree, nu),
            d: s.w.cross(&s.d),
            w,
        }
    }

    fn plus_rates(&self, s: &Self::State, by: &[(f64, &Self::Rate)]) -> Self::State {
        let mut out = *s;
        for (k, r) in by {
            out.tree = self.tree.plus_rates(&out.tree, &[(*k, &r.tree)]);
            out.d += r.d * *k;
            out.w += r.w * *k;
        }
        out
    }

    fn projected(&self, s: Self::State) -> Self::State {
        let d = s.d.normalize();
        SloshState {
            tree: self.tree.projected(s.tree),
            d,
            w: s.w - d * d.dot(&s.w),
        }
    }
}
