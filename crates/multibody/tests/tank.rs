//! Derivation of the stock pendulum: linear slosh in a half-full sphere, and the damping measured in one.

mod common;

use common::servicer;
use multibody::Description;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::PI;

/// Solid harmonics that vary as cos φ about the vertical axis; eight give five digits.
const TERMS: usize = 10;
type Matrix = SMatrix<f64, TERMS, TERMS>;
type Vector = SVector<f64, TERMS>;

/// Density of hydrazine at 20 °C, kg/m³.
const DENSITY: f64 = 1008.0;
/// Its dynamic viscosity between 20 and 25 °C, Pa s.
const VISCOSITY: f64 = 0.91e-3;
/// Standard gravity, m/s².
const GRAVITY: f64 = 9.80665;

/// `r^k P_k^1` for k = 0 to TERMS at distance `s` from the axis and height `z`; the first is zero.
fn harmonics(s: f64, z: f64) -> [f64; TERMS + 1] {
    let mut h = [0.0; TERMS + 1];
    h[1] = s;
    for k in 2..=TERMS {
        let n = k as f64;
        h[k] = ((2.0 * n - 1.0) * z * h[k - 1] - n * (s * s + z * z) * h[k - 2]) / (n - 1.0);
    }
    h
}

/// Simpson's rule.
fn integrate(from: f64, to: f64, mut add: impl FnMut(f64, f64)) {
    const STEPS: usize = 400;
    let h = (to - from) / STEPS as f64;
    for i in 0..=STEPS {
        let weight = match i {
            0 | STEPS => 1.0,
            _ if i % 2 == 1 => 4.0,
            _ => 2.0,
        };
        add(from + i as f64 * h, weight * h / 3.0);
    }
}

/// The first lateral mode in the lower half of the unit sphere: `λ = ω² R / g`, and the part of the liquid that moves.
///
/// Harmonic potentials a · h that make `∮ φ ∂φ/∂n` stationary against `λ ∫ φ²` over the free surface meet `∂φ/∂n = λ φ` there and
/// `∂φ/∂n = 0` at the wall. The surface at elevation φ carries the momentum `ρ ∫ φ x` and the kinetic energy `ρ/λ ∫ φ² / 2`, so the
/// pendulum with the same momentum and energy has the mass `ρ λ (∫ φ x)² / ∫ φ²`.
fn first_mode() -> (f64, f64) {
    let (mut flow, mut surface, mut moment) = (Matrix::zeros(), Matrix::zeros(), Vector::zeros());
    integrate(0.0, 1.0, |s, weight| {
        let h = harmonics(s, 0.0);
        for i in 0..TERMS {
            moment[i] += weight * s * s * h[i + 1];
            for j in 0..TERMS {
                surface[(i, j)] += weight * s * h[i + 1] * h[j + 1];
                // ∂/∂z of r^k P_k^1 is (k + 1) r^(k−1) P_(k−1)^1
                flow[(i, j)] += weight * s * h[i + 1] * (j + 2) as f64 * h[j];
            }
        }
    });
    integrate(0.5 * PI, PI, |theta, weight| {
        let h = harmonics(libm::sin(theta), libm::cos(theta));
        for i in 0..TERMS {
            for j in 0..TERMS {
                flow[(i, j)] += weight * libm::sin(theta) * h[i + 1] * (j + 1) as f64 * h[j + 1];
            }
        }
    });
    let factors = flow.lu();
    let mut mode = Vector::zeros();
    mode[0] = 1.0;
    for _ in 0..60 {
        mode = factors.solve(&(surface * mode)).expect("regular").normalize();
    }
    let size = mode.dot(&(surface * mode));
    let lambda = mode.dot(&(flow * mode)) / size;
    let moved = PI * lambda * moment.dot(&mode) * moment.dot(&mode) / size;
    (lambda, moved / (2.0 * PI / 3.0))
}

struct Pendulum {
    liquid_kg: f64,
    mass_kg: f64,
    length_m: f64,
    damping_kg_m2_s: f64,
}

/// Half-full sphere of hydrazine of radius `r`, m.
fn pendulum(r: f64) -> Pendulum {
    let (lambda, part) = first_mode();
    let liquid_kg = DENSITY * 2.0 * PI / 3.0 * r.powi(3);
    let (mass_kg, length_m) = (part * liquid_kg, r / lambda);
    // logarithmic decrement in half-full spheres, Sumner and Stofan 1963 (NASA TN D-1991), as quoted in NASA SP-106
    let diameter = 2.0 * r;
    let decrement = 0.131
        * libm::pow(
            1e4 * VISCOSITY / DENSITY / libm::sqrt(GRAVITY * diameter.powi(3)),
            0.359,
        );
    // ζ = δ / 2π and β = 2 ζ ω m L²
    let damping_kg_m2_s = decrement / PI * libm::sqrt(GRAVITY / length_m) * mass_kg * length_m * length_m;
    Pendulum {
        liquid_kg,
        mass_kg,
        length_m,
        damping_kg_m2_s,
    }
}

/// Mass, length and damping of the pendulum, and mass of the liquid at rest, of a model.
fn of_model(d: &Description) -> [f64; 4] {
    let link = |name: &str| {
        d.links
            .iter()
            .find(|link| link.name == name)
            .and_then(|link| link.inertia)
            .expect("there")
    };
    let hinge = d.joints.iter().find(|joint| joint.name == "slosh_x").expect("there");
    let bob = link("slosh_bob");
    [bob.mass, -bob.com.z, hinge.damping, link("tank").mass]
}

#[test]
fn first_mode_of_a_half_full_sphere() {
    let (lambda, part) = first_mode();
    assert!((lambda - 1.5602).abs() < 5e-5, "{lambda}");
    assert!(
        (1.0 / lambda - 0.641).abs() < 5e-5 && (part - 0.5797).abs() < 5e-5,
        "{part}"
    );
}

#[test]
fn stock_pendulum_is_that_of_its_tank() {
    let p = pendulum(0.2054);
    println!(
        "liquid {:.3} kg, pendulum {:.3} kg on {:.4} m, damping {:.5} kg m²/s",
        p.liquid_kg, p.mass_kg, p.length_m, p.damping_kg_m2_s
    );
    let [mass, length, damping, rest] = of_model(&servicer());
    assert!((p.mass_kg - mass).abs() < 0.005 && (p.liquid_kg - p.mass_kg - rest).abs() < 0.005);
    assert!((p.length_m - length).abs() < 5e-5);
    assert!((p.damping_kg_m2_s - damping).abs() < 5e-5, "{}", p.damping_kg_m2_s);
}

/// The radius follows from the published damping, which grows nearly as R⁴.
#[test]
fn radius_follows_from_the_published_damping() {
    let (mut low, mut high) = (0.1, 0.4);
    for _ in 0..50 {
        let middle = 0.5 * (low + high);
        if pendulum(middle).damping_kg_m2_s < 0.0131 {
            low = middle
        } else {
            high = middle
        }
    }
    assert!((low - 0.2054).abs() < 2e-4, "{low}");
}

#[test]
fn large_tank_has_the_same_shape_of_pendulum() {
    let text = include_str!("../../../models/servicer-large-tank.urdf");
    let [mass, length, damping, rest] = of_model(&Description::from_urdf(text).expect("valid"));
    let p = pendulum(0.359);
    assert!(
        (p.mass_kg - mass).abs() < 0.15 && (p.liquid_kg - mass - rest).abs() < 0.4,
        "{} {}",
        p.mass_kg,
        p.liquid_kg
    );
    assert!((p.length_m - length).abs() < 5e-4);
    // at 1 g its own damping would be nine times that of the small tank, which the scenario keeps
    assert!(
        damping == 0.0131 && (p.damping_kg_m2_s / damping - 9.1).abs() < 0.2,
        "{}",
        p.damping_kg_m2_s
    );
}
