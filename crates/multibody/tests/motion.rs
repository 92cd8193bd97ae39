//! Motion of the stock servicer: conservation, convergence order, and time reversal.

mod common;

use common::servicer;
use multibody::{Description, Inertia, Method, OdeSystem, Quaternion, State, Tree, dop853, rk4};
use nalgebra::{Matrix3, SVector, Vector3};

type Servicer = Tree<9, 15>;
type ServicerState = State<9, 15>;

const H: f64 = 1e-3;

/// A gentle tumble with every joint moving and the bob swinging, as in a capture.
fn start() -> ServicerState {
    let mut s = State::rest();
    s.p_nb = Vector3::new(-0.42, 0.1, -2.85);
    s.quat_nb = Quaternion {
        w: 0.9,
        x: 0.1,
        y: -0.3,
        z: 0.2,
    }
    .normalized();
    s.q = SVector::from_column_slice(&[0.2, 0.7, -0.1, 1.4, 0.3, 0.7, 0.1, 0.3, -0.4]);
    s.nu = SVector::from_column_slice(&[
        0.02, -0.03, 0.05, 0.04, 0.02, -0.06, 0.05, -0.04, 0.06, 0.03, -0.08, 0.05, 0.07, 0.3, -0.2,
    ]);
    s
}

fn undamped() -> Servicer {
    let mut d = servicer();
    d.set_damping("slosh_y", 0.0)
        .and_then(|d| d.set_damping("slosh_x", 0.0))
        .expect("they exist");
    Tree::new(&d).expect("valid")
}

/// Momenta in world axes and kinetic energy.
fn invariants(tree: &Servicer, s: &ServicerState) -> (Vector3<f64>, Vector3<f64>, f64) {
    let k = tree.kinematics(&s.q, &s.nu);
    let m = tree.momentum(&k);
    (
        s.quat_nb.rotate(&m.linear_b),
        s.quat_nb.rotate(&m.angular_b),
        tree.kinetic_energy(&k),
    )
}

#[test]
fn free_motion_for_a_minute_conserves_momentum_and_energy() {
    for method in [Method::Rk4, Method::Rkmk4] {
        let tree = undamped();
        let tau = SVector::zeros();
        let mut s = start();
        let (p0, l0, e0) = invariants(&tree, &s);
        let (mut dp, mut dl, mut de) = (0.0_f64, 0.0_f64, 0.0_f64);
        for step in 0..60_000 {
            s = tree.step(method, &s, &tau, H);
            if step % 500 == 499 {
                let (p, l, e) = invariants(&tree, &s);
                dp = dp.max((p - p0).norm() / p0.norm());
                dl = dl.max((l - l0).norm() / l0.norm());
                de = de.max((e - e0).abs() / e0);
            }
        }
        println!("{method}: linear {dp:.2e}, angular {dl:.2e}, energy {de:.2e}");
        assert!(dp < 1e-12 && dl < 1e-12 && de < 1e-12, "{method}: {dp:e} {dl:e} {de:e}");
    }
}

/// The stock servicer with the work of its dampers as one more coordinate, integrated by the same method.
struct WithDissipatedEnergy(Servicer);

impl OdeSystem for WithDissipatedEnergy {
    type State = (ServicerState, f64);
    type Rate = (<Servicer as OdeSystem>::Rate, f64);
    type Force = SVector<f64, 15>;

    fn rate(&self, s: &Self::State, tau: &Self::Force) -> Self::Rate {
        (self.0.rate(&s.0, tau), self.0.damper_power(&s.0.nu))
    }
    fn plus_rates(&self, s: &Self::State, by: &[(f64, &Self::Rate)]) -> Self::State {
        let mut out = *s;
        for (k, r) in by {
            out = (self.0.plus_rates(&out.0, &[(*k, &r.0)]), out.1 + k * r.1);
        }
        out
    }
    fn projected(&self, s: Self::State) -> Self::State {
        (self.0.projected(s.0), s.1)
    }
}

#[test]
fn energy_lost_is_the_work_of_the_dampers() {
    let tree = WithDissipatedEnergy(Tree::new(&servicer()).expect("valid"));
    let tau = SVector::zeros();
    let mut s = (start(), 0.0);
    let (_, _, e0) = invariants(&tree.0, &s.0);
    let mut worst = 0.0_f64;
    for step in 0..60_000 {
        s = rk4(&tree, &s, &tau, H);
        if step % 500 == 499 {
            let (_, _, e) = invariants(&tree.0, &s.0);
            worst = worst.max((e - e0 - s.1).abs() / e0);
        }
    }
    println!("energy balance {worst:.2e}, of which dampers took {:.3}", -s.1 / e0);
    assert!(-s.1 > 1e-3 * e0, "the dampers did work");
    assert!(worst < 1e-12, "{worst:e}");
}

fn distance(a: &ServicerState, b: &ServicerState) -> f64 {
    let turn = a.quat_nb.conjugate().times(b.quat_nb);
    let turn = 2.0 * (turn.x * turn.x + turn.y * turn.y + turn.z * turn.z).sqrt();
    (a.p_nb - b.p_nb).norm() + turn + (a.q - b.q).norm() + (a.nu - b.nu).norm()
}

fn run(
    tree: &Servicer,
    method: Method,
    s: &ServicerState,
    tau: &SVector<f64, 15>,
    h: f64,
    steps: usize,
) -> ServicerState {
    (0..steps).fold(*s, |s, _| tree.step(method, &s, tau, h))
}

/// Brisk enough for truncation to stand far above rounding, forces held.
fn fast_motion() -> (ServicerState, SVector<f64, 15>) {
    let mut s = start();
    s.nu *= 8.0;
    (
        s,
        SVector::from_column_slice(&[
            1.0, -0.5, 2.0, 3.0, -2.0, 1.0, 0.5, 0.3, 0.2, 0.1, -0.02, -0.03, 0.001, 0.0, 0.0,
        ]),
    )
}

#[test]
fn observed_orders() {
    let tree = Tree::new(&servicer()).expect("valid");
    let (s, tau) = fast_motion();
    let t = 0.8;
    let truth = run(&tree, Method::Dop853, &s, &tau, t / 800.0, 800);
    // at steps this long dop853's eighth-order error does not yet dominate, and at shorter ones rounding does
    for (method, steps, order) in [
        (Method::Rk4, 160, 3.9..4.1),
        (Method::Rkmk4, 160, 3.9..4.1),
        (Method::Dop853, 12, 7.5..10.5),
    ] {
        let error = |n: usize| distance(&run(&tree, method, &s, &tau, t / n as f64, n), &truth);
        let (coarse, fine) = (error(steps), error(2 * steps));
        let seen = libm::log2(coarse / fine);
        println!("{method}: {coarse:.2e} -> {fine:.2e}, order {seen:.3}");
        assert!(
            order.contains(&seen),
            "{method}: order {seen}, errors {coarse:e} {fine:e}"
        );
    }
}

#[test]
fn time_runs_backwards() {
    let tree = undamped();
    let (s, tau) = (start(), SVector::zeros());
    for method in [Method::Rk4, Method::Rkmk4, Method::Dop853] {
        let there = run(&tree, method, &s, &tau, H, 5000);
        let back = run(&tree, method, &there, &tau, -H, 5000);
        let error = distance(&s, &back);
        println!("{method}: {error:.2e} after 5 s there and back");
        assert!(error < 1e-11, "{method}: {error:e}");
    }
}

/// Torque-free motion of an axisymmetric body (Euler): ω precesses at (I₃ − I₁)/I₁ · ω₃ in body axes.
#[test]
fn torque_free_symmetric_top() {
    let inertia = Inertia {
        mass: 150.0,
        com: Vector3::zeros(),
        about_com: Matrix3::from_diagonal(&Vector3::new(33.6, 33.6, 25.0)),
    };
    let tree = Tree::<0, 6>::new(&Description::rigid_body("target", inertia).expect("valid")).expect("valid");
    let mut s = State::<0, 6>::rest();
    s.nu = SVector::from_column_slice(&[0.01, 0.02, 0.05, 0.0, 0.0, 0.0]);
    let (n, h) = (30_000_u32, 1e-3);
    for _ in 0..n {
        s = tree.step(Method::Rk4, &s, &SVector::zeros(), h);
    }
    let rate = (25.0 - 33.6) / 33.6 * 0.05;
    let (sin, cos) = multibody::sin_cos(rate * f64::from(n) * h);
    // ω₁' = −rate ω₂, ω₂' = rate ω₁ with this sign of rate
    let want = Vector3::new(0.01 * cos - 0.02 * sin, 0.02 * cos + 0.01 * sin, 0.05);
    assert!((s.omega() - want).norm() < 1e-14, "{:e}", (s.omega() - want).norm());
}

#[test]
fn methods_have_names() {
    for method in [Method::Rk4, Method::Rkmk4, Method::Dop853] {
        assert_eq!(method.to_string().parse(), Ok(method));
    }
    let error = "euler".parse::<Method>().unwrap_err().to_string();
    assert!(error.contains("`euler`") && error.contains("rkmk4"), "{error}");
    let _ = dop853::<Servicer>;
}
