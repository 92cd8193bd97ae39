//! Runge-Kutta-Munthe-Kaas on SE(3) × ℝᴺ × ℝⱽ (Munthe-Kaas, *High order Runge-Kutta methods on manifolds*, Appl. Numer.
//! Math. 29, 1999; Iserles et al., *Lie-group methods*, Acta Numerica 2000, §4).
//!
//! The pose is `g = g₀ exp(σ)` with σ = [turn; shift] in base axes, and ġ = g ξ with the body twist ξ = [ω; v] gives
//! `σ̇ = ξ + ½ [σ, ξ] + 1/12 [σ, [σ, ξ]] + O(σ⁴)`: the neglected terms are of fifth order in a step.

use crate::rotation::Quaternion;
use crate::state::State;
use crate::tree::Tree;
use nalgebra::{SVector, Vector3};

#[derive(Clone, Copy)]
struct Twist {
    ang: Vector3<f64>,
    lin: Vector3<f64>,
}

impl Twist {
    const fn new(ang: Vector3<f64>, lin: Vector3<f64>) -> Self {
        Self { ang, lin }
    }

    /// self + k o.
    fn plus(self, k: f64, o: Self) -> Self {
        Self::new(self.ang + o.ang * k, self.lin + o.lin * k)
    }

    fn bracket(self, o: Self) -> Self {
        Self::new(self.ang.cross(&o.ang), self.ang.cross(&o.lin) + self.lin.cross(&o.ang))
    }
}

fn sigma_rate(sigma: Twist, xi: Twist) -> Twist {
    let once = sigma.bracket(xi);
    xi.plus(0.5, once).plus(1.0 / 12.0, sigma.bracket(once))
}

/// g₀ exp(σ).
fn retract<const N: usize, const V: usize>(s: &State<N, V>, sigma: Twist) -> (Vector3<f64>, Quaternion) {
    let turn = Quaternion::exp(&sigma.ang);
    // the shift of exp is V σ_lin, V = 1 + b [φ] + c [φ]², b = (1 − cos φ)/φ², c = (φ − sin φ)/φ³
    let phi2 = sigma.ang.norm_squared();
    let (b, c) = if phi2 < 1.0e-2 {
        // series: the closed forms suffer cancellation; the neglected terms are below 2e-18
        let b = 0.5 + phi2 * (-1.0 / 24.0 + phi2 * (1.0 / 720.0 + phi2 * (-1.0 / 40_320.0 + phi2 / 3_628_800.0)));
        let c = 1.0 / 6.0
            + phi2 * (-1.0 / 120.0 + phi2 * (1.0 / 5_040.0 + phi2 * (-1.0 / 362_880.0 + phi2 / 39_916_800.0)));
        (b, c)
    } else {
        let phi = phi2.sqrt();
        let (sin, cos) = crate::num::sin_cos(phi);
        ((1.0 - cos) / phi2, (phi - sin) / (phi2 * phi))
    };
    let once = sigma.ang.cross(&sigma.lin);
    let shift = sigma.lin + once * b + sigma.ang.cross(&once) * c;
    (s.p_nb + s.quat_nb.rotate(&shift), s.quat_nb.times(turn))
}

pub(super) fn step<const N: usize, const V: usize>(
    tree: &Tree<N, V>,
    s: &State<N, V>,
    tau: &SVector<f64, V>,
    h: f64,
) -> State<N, V> {
    type Slope<const N: usize, const V: usize> = (Twist, SVector<f64, N>, SVector<f64, V>);
    let zero = Twist::new(Vector3::zeros(), Vector3::zeros());
    let stage = |sigma: Twist, q: SVector<f64, N>, nu: SVector<f64, V>| -> Slope<N, V> {
        let (p_nb, quat_nb) = retract(s, sigma);
        let at = State { p_nb, quat_nb, q, nu };
        let rates = SVector::from_fn(|i, _| nu[V - N + i]);
        (
            sigma_rate(sigma, Twist::new(at.omega(), at.velocity())),
            rates,
            tree.forward_dynamics(&at, tau),
        )
    };
    let from = |k: &Slope<N, V>, h: f64| stage(zero.plus(h, k.0), s.q + k.1 * h, s.nu + k.2 * h);
    let k1 = stage(zero, s.q, s.nu);
    let k2 = from(&k1, 0.5 * h);
    let k3 = from(&k2, 0.5 * h);
    let k4 = from(&k3, h);
    let (a, b) = (h / 6.0, h / 3.0);
    let sigma = zero.plus(a, k1.0).plus(b, k2.0).plus(b, k3.0).plus(a, k4.0);
    let (p_nb, quat_nb) = retract(s, sigma);
    State {
        p_nb,
        quat_nb: quat_nb.normalized(), // against rounding only: the product of unit quaternions is one
        q: s.q + (k1.1 + k4.1) * a + (k2.1 + k3.1) * b,
        nu: s.nu + (k1.2 + k4.2) * a + (k2.2 + k3.2) * b,
    }
}
