//! Shared by the integration tests.
#![allow(dead_code)] // each test program uses its own part

pub(crate) mod dense;
pub(crate) mod dual;
pub(crate) mod random;
pub(crate) mod slow;

use multibody::{Description, Quaternion, State};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};
use serde_json::Value;

pub(crate) fn servicer() -> Description {
    Description::from_urdf(include_str!("../../../../models/servicer.urdf")).expect("the stock model is valid")
}

/// One state of the reference file with all its reference values.
pub(crate) struct Reference {
    pub state: State<9, 15>,
    pub tau: SVector<f64, 15>,
    pub mass: SMatrix<f64, 15, 15>,
    pub bias: SVector<f64, 15>,
    pub acceleration: SVector<f64, 15>,
    pub energy: f64,
    pub linear: Vector3<f64>,
    pub angular: Vector3<f64>,
    pub com: Vector3<f64>,
    pub p: Vector3<f64>,
    pub r: Matrix3<f64>,
    pub j: SMatrix<f64, 6, 15>,
    pub j_rate: SMatrix<f64, 6, 15>,
}

fn vector<const N: usize>(v: &Value) -> SVector<f64, N> {
    let a = v.as_array().expect("an array");
    assert_eq!(a.len(), N);
    SVector::from_fn(|i, _| a[i].as_f64().expect("a number"))
}

fn matrix<const R: usize, const C: usize>(v: &Value) -> SMatrix<f64, R, C> {
    let a = v.as_array().expect("an array of rows");
    assert_eq!(a.len(), R);
    SMatrix::from_fn(|i, j| a[i][j].as_f64().expect("a number"))
}

pub(crate) fn load_reference() -> Vec<Reference> {
    let file: Value = serde_json::from_str(include_str!("../data/dynamics-reference.json")).expect("valid JSON");
    let each = |s: &Value| {
        let (at, e) = (&s["state"], &s["end_effector"]);
        Reference {
            state: State {
                p_nb: vector(&at["p"]),
                quat_nb: Quaternion::from_wxyz(vector::<4>(&at["quat_wxyz"]).into()),
                q: vector(&at["qj"]),
                nu: vector(&at["v"]),
            },
            tau: vector(&at["tau"]),
            mass: matrix(&s["M"]),
            bias: vector(&s["bias"]),
            acceleration: vector(&s["acceleration"]),
            energy: s["kinetic_energy"].as_f64().expect("a number"),
            linear: vector(&s["linear_momentum_N"]),
            angular: vector(&s["angular_momentum_about_com_N"]),
            com: vector(&s["com_N"]),
            p: vector(&e["p_N"]),
            r: matrix(&e["R_NE"]),
            j: matrix(&e["J_body"]),
            j_rate: matrix(&e["Jdot_body"]),
        }
    };
    file["states"].as_array().expect("states").iter().map(each).collect()
}

/// √(aᵀ M a): the size of an acceleration.
pub(crate) fn m_norm<const V: usize>(m: &SMatrix<f64, V, V>, a: &SVector<f64, V>) -> f64 {
    (a.transpose() * m * a)[0].max(0.0).sqrt()
}

/// √(fᵀ M⁻¹ f): the size of a force.
pub(crate) fn m_inv_norm<const V: usize>(m: &SMatrix<f64, V, V>, f: &SVector<f64, V>) -> f64 {
    f.dot(&solve(m, f)).max(0.0).sqrt()
}

/// M⁻¹ f by Cholesky.
pub(crate) fn solve<const V: usize>(m: &SMatrix<f64, V, V>, f: &SVector<f64, V>) -> SVector<f64, V> {
    let mut l = *m;
    let mut x = *f;
    for j in 0..V {
        for k in 0..j {
            let t = l[(j, k)];
            for i in j..V {
                l[(i, j)] -= l[(i, k)] * t;
            }
        }
        let d = l[(j, j)].sqrt();
        assert!(
            d > 0.0,
            "the matrix is not positive definite: pivot {j} is {}",
            l[(j, j)]
        );
        for i in j..V {
            l[(i, j)] /= d;
        }
    }
    for i in 0..V {
        for k in 0..i {
            x[i] -= l[(i, k)] * x[k];
        }
        x[i] /= l[(i, i)];
    }
    for i in (0..V).rev() {
        for k in i + 1..V {
            x[i] -= l[(k, i)] * x[k];
        }
        x[i] /= l[(i, i)];
    }
    x
}
