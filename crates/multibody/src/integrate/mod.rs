//! Integrators, by name.
//!
//! A step takes the *value* of the generalised force and holds it (zero-order hold): the plant's inputs are held over a
//! step, and a controller sampled inside the stages would reduce every method to first order.
//!
//! | name | method | order |
//! |---|---|---|
//! | `rk4` | classical Runge-Kutta on (p, quaternion, q, ν), quaternion renormalised after the step; the baseline | 4 |
//! | `rkmk4` | Runge-Kutta-Munthe-Kaas on SE(3) × joints: the pose moves by exponentials and stays on the group | 4 |
//! | `dop853` | Dormand and Prince, 12 stages, fixed step; the reference in convergence tests | 8 |

mod dop853;
mod ode_system;
mod rk4;
mod rkmk4;

pub use ode_system::OdeSystem;

use crate::num::Number;
use crate::rotation::Quaternion;
use crate::state::State;
use crate::tree::Tree;
use nalgebra::{SVector, Vector3};

/// An integration method, by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Method {
    /// Classical Runge-Kutta, order 4.
    #[default]
    Rk4,
    /// Runge-Kutta-Munthe-Kaas on SE(3), order 4.
    Rkmk4,
    /// Dormand-Prince 8(5,3) with a fixed step, order 8.
    Dop853,
}

/// No method of that name.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("there is no integrator `{0}`; the integrators are rk4, rkmk4 and dop853")]
pub struct UnknownMethod(pub String);

impl core::str::FromStr for Method {
    type Err = UnknownMethod;
    fn from_str(s: &str) -> Result<Self, UnknownMethod> {
        match s {
            "rk4" => Ok(Self::Rk4),
            "rkmk4" => Ok(Self::Rkmk4),
            "dop853" => Ok(Self::Dop853),
            other => Err(UnknownMethod(other.to_owned())),
        }
    }
}

impl core::fmt::Display for Method {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        f.write_str(match self {
            Self::Rk4 => "rk4",
            Self::Rkmk4 => "rkmk4",
            Self::Dop853 => "dop853",
        })
    }
}

/// One step of `h` seconds of classical Runge-Kutta on any [`OdeSystem`].
#[inline(always)]
pub fn rk4<F: OdeSystem>(system: &F, state: &F::State, force: &F::Force, h: f64) -> F::State {
    rk4::step(system, state, force, h)
}

/// One step of `h` seconds of Dormand and Prince's eighth-order method on any [`OdeSystem`].
pub fn dop853<F: OdeSystem>(system: &F, state: &F::State, force: &F::Force, h: f64) -> F::State {
    dop853::step(system, state, force, h)
}

/// Rates of the coordinates of a [`State`].
#[derive(Clone, Copy, Debug)]
pub struct Rate<const N: usize, const V: usize, T = f64> {
    /// ṗ_NB (N axes, m/s).
    pub p_nb: Vector3<T>,
    /// Rate of the quaternion.
    pub quat_nb: Quaternion<T>,
    /// Joint rates.
    pub q: SVector<T, N>,
    /// ν̇.
    pub nu: SVector<T, V>,
}

impl<const N: usize, const V: usize, T: Number> Rate<N, V, T> {
    /// The kinematic rates of `s`, with ν̇ as given.
    #[inline(always)]
    pub fn of(s: &State<N, V, T>, nu_dot: SVector<T, V>) -> Self {
        Self {
            p_nb: s.quat_nb.rotate(&s.velocity()),
            quat_nb: s.quat_nb.rate(&s.omega()),
            q: SVector::from_fn(|i, _| s.nu[V - N + i]),
            nu: nu_dot,
        }
    }
}

impl<const N: usize, const V: usize, T: Number> State<N, V, T> {
    /// `self + Σ kᵢ rateᵢ`, coordinate by coordinate.
    #[inline(always)]
    pub fn plus_rates(&self, by: &[(f64, &Rate<N, V, T>)]) -> Self {
        let mut out = *self;
        for (k, rate) in by {
            out.add_rate(*k, rate);
        }
        out
    }

    /// Adds `k rate`, coordinate by coordinate.
    #[inline(always)]
    pub fn add_rate(&mut self, k: f64, rate: &Rate<N, V, T>) {
        let k = T::of(k);
        for i in 0..3 {
            self.p_nb[i] = k.mul_add(rate.p_nb[i], self.p_nb[i]);
        }
        self.quat_nb = self.quat_nb.plus(k, rate.quat_nb);
        for i in 0..N {
            self.q[i] = k.mul_add(rate.q[i], self.q[i]);
        }
        for i in 0..V {
            self.nu[i] = k.mul_add(rate.nu[i], self.nu[i]);
        }
    }
}

impl<const N: usize, const V: usize> OdeSystem for Tree<N, V> {
    type State = State<N, V>;
    type Rate = Rate<N, V>;
    type Force = SVector<f64, V>;

    #[inline(always)]
    fn rate(&self, s: &State<N, V>, tau: &SVector<f64, V>) -> Rate<N, V> {
        Rate::of(s, self.forward_dynamics(s, tau))
    }

    #[inline(always)]
    fn plus_rates(&self, s: &State<N, V>, by: &[(f64, &Rate<N, V>)]) -> State<N, V> {
        s.plus_rates(by)
    }

    #[inline(always)]
    fn projected(&self, s: State<N, V>) -> State<N, V> {
        s.projected()
    }
}

impl<const N: usize, const V: usize> Tree<N, V> {
    /// One step of `h` seconds (negative: backwards in time) with the generalised force `tau` held.
    pub fn step(&self, method: Method, state: &State<N, V>, tau: &SVector<f64, V>, h: f64) -> State<N, V> {
        match method {
            Method::Rk4 => rk4::step(self, state, tau, h),
            Method::Rkmk4 => rkmk4::step(self, state, tau, h),
            Method::Dop853 => dop853::step(self, state, tau, h),
        }
    }
}
