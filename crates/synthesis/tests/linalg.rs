//! Decompositions against their definitions, and on matrices with known answers that are hard for iterations.

use proptest::prelude::*;
use synthesis::linalg::{
    CMatrix, LinalgError, Matrix, adjoint, c64, cholesky, diagonal, eigen, eigen_complex, eigenvalues,
    eigenvalues_complex, expm, factor, hermitian_eigen, inverse, least_squares, max_abs, singular_values, solve,
    solve_complex, svd, symmetric_eigen, to_complex,
};

/// A matrix of entries between −1 and 1.
fn matrix(rows: usize, columns: usize, seed: u64) -> Matrix {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    Matrix::from_fn(rows, columns, |_, _| {
        state = state
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    })
}

fn complex(rows: usize, columns: usize, seed: u64) -> CMatrix {
    let (re, im) = (matrix(rows, columns, seed), matrix(rows, columns, seed + 1000));
    CMatrix::from_fn(rows, columns, |i, j| c64::new(re[(i, j)], im[(i, j)]))
}

/// The largest distance of a value from its nearest partner in the other list, each partner used once.
fn distance(found: &[c64], expected: &[c64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let mut left = expected.to_vec();
    found.iter().fold(0.0, |largest, value| {
        let nearest = (0..left.len())
            .min_by(|&i, &j| (left[i] - value).norm().total_cmp(&(left[j] - value).norm()))
            .unwrap();
        f64::max(largest, (left.swap_remove(nearest) - value).norm())
    })
}

fn real_values(values: &[f64]) -> Vec<c64> {
    values.iter().map(|&x| c64::new(x, 0.0)).collect()
}

#[test]
fn cyclic_permutation_has_roots_of_unity() {
    for n in [2, 3, 4, 7, 16, 33] {
        let m = Matrix::from_fn(n, n, |i, j| f64::from(u8::from(i == (j + 1) % n)));
        let roots: Vec<c64> = (0..n)
            .map(|k| c64::from_polar(1.0, 2.0 * std::f64::consts::PI * k as f64 / n as f64))
            .collect();
        assert!(distance(&eigenvalues(&m).unwrap(), &roots) < 1e-13, "{n}");
        assert!(
            distance(&eigenvalues_complex(&to_complex(&m)).unwrap(), &roots) < 1e-13,
            "{n}"
        );
    }
}

/// Samples in transit are shifted from slot to slot: eigenvalue zero, with a chain as long as the delay.
#[test]
fn shift_register_has_eigenvalue_zero() {
    for (n, upper) in [(5, true), (5, false), (40, true), (40, false)] {
        let m = Matrix::from_fn(n, n, |i, j| {
            f64::from(u8::from(if upper { j == i + 1 } else { i == j + 1 }))
        });
        assert_eq!(eigenvalues(&m).unwrap(), vec![c64::new(0.0, 0.0); n]);
        assert_eq!(
            eigenvalues_complex(&to_complex(&m)).unwrap(),
            vec![c64::new(0.0, 0.0); n]
        );
    }
}

/// Wilkinson's polynomial of degree 10, and a pair of poles on the axis, as companion matrices.
#[test]
fn companion_matrix_has_roots_of_polynomial() {
    let companion = |coefficients: &[f64]| {
        let n = coefficients.len();
        Matrix::from_fn(n, n, |i, j| {
            if i == 0 {
                -coefficients[j]
            } else {
                f64::from(u8::from(i == j + 1))
            }
        })
    };
    let mut polynomial = vec![1.0];
    for root in 1..=10 {
        let mut next = polynomial.clone();
        next.push(0.0);
        for (k, c) in polynomial.iter().enumerate() {
            next[k + 1] -= f64::from(root) * c;
        }
        polynomial = next;
    }
    let roots: Vec<f64> = (1..=10).map(f64::from).collect();
    let found = eigenvalues(&companion(&polynomial[1..])).unwrap();
    // The roots move by 1e7 times the relative change of a coefficient.
    assert!(distance(&found, &real_values(&roots)) < 1e-6, "{found:?}");
    let found = eigenvalues(&companion(&[0.0, 4.0])).unwrap();
    assert_eq!(found, [c64::new(0.0, 2.0), c64::new(0.0, -2.0)]);
}

/// A subdiagonal entry that is small, but not beside what it multiplies: powers of the eigenvalues sum up to traces of powers.
#[test]
fn small_subdiagonal_entry_is_not_neglected() {
    for (seed, small) in (0..40).flat_map(|seed| [1e-4, 1e-6, 1e-7, 1e-8].map(|small| (seed, small))) {
        let n = 9;
        let random = matrix(n, n, seed);
        let m = Matrix::from_fn(n, n, |i, j| match (i, j) {
            (4, 3) => small,
            _ if i > j + 1 => 0.0,
            _ => random[(i, j)],
        });
        let (mut power, mut complex) = (m.clone(), eigenvalues_complex(&to_complex(&m)).unwrap());
        let mut real = eigenvalues(&m).unwrap();
        let (first, other) = (real.clone(), complex.clone());
        for exponent in 1..=4 {
            let trace: f64 = (0..n).map(|i| power[(i, i)]).sum();
            for values in [&real, &complex] {
                let sum: c64 = values.iter().sum();
                assert!(
                    (sum - trace).norm() < 1e-12,
                    "seed {seed}, {small}, power {exponent}: {sum}, {trace}"
                );
            }
            power = &power * &m;
            real.iter_mut().zip(&first).for_each(|(x, one)| *x *= one);
            complex.iter_mut().zip(&other).for_each(|(x, one)| *x *= one);
        }
    }
}

#[test]
fn rotation_and_scaling_blocks_keep_exact_eigenvalues() {
    // Diagonal and block-diagonal matrices, of entries that differ by many orders of magnitude.
    let values = [1e-200, -3.0, 7e120, 0.0, 2.5];
    assert!(distance(&eigenvalues(&diagonal(&values)).unwrap(), &real_values(&values)) == 0.0);
    let m = Matrix::from_fn(2, 2, |i, j| [[3.0, -4.0], [4.0, 3.0]][i][j]);
    assert_eq!(eigenvalues(&m).unwrap(), [c64::new(3.0, 4.0), c64::new(3.0, -4.0)]);
    assert_eq!(eigenvalues(&Matrix::zeros(0, 0)).unwrap(), []);
    assert_eq!(eigenvalues(&diagonal(&[5.0])).unwrap(), real_values(&[5.0]));
}

#[test]
fn matrix_that_is_not_finite_is_refused() {
    for value in [f64::NAN, f64::INFINITY] {
        let mut m = matrix(4, 4, 1);
        m[(2, 1)] = value;
        assert!(matches!(
            eigenvalues(&m),
            Err(LinalgError::NotFinite { row: 2, column: 1, .. })
        ));
        assert!(matches!(symmetric_eigen(&m), Err(LinalgError::NotFinite { .. })));
        let m = to_complex(&m);
        assert!(matches!(
            eigenvalues_complex(&m),
            Err(LinalgError::NoConvergence { size: 4, .. })
        ));
        assert!(matches!(eigen_complex(&m), Err(LinalgError::NoConvergence { .. })));
        assert!(matches!(singular_values(&m), Err(LinalgError::NoConvergence { .. })));
        assert!(matches!(hermitian_eigen(&m), Err(LinalgError::NoConvergence { .. })));
    }
}

#[test]
fn singular_system_is_refused() {
    for n in [1, 3, 30, 49] {
        let mut m = matrix(n, n, n as u64);
        (0..n).for_each(|i| m[(i, n / 2)] = 0.0);
        let b = Matrix::identity(n, n);
        assert_eq!(solve(&m, &b), Err(LinalgError::Singular { size: n }));
        assert!(!solve_complex(&to_complex(&m), &to_complex(&b)).is_finite());
    }
}

#[test]
fn indefinite_hermitian_matrix_has_no_factor() {
    let m = CMatrix::from_fn(2, 2, |i, j| {
        [
            [c64::new(1.0, 0.0), c64::new(0.0, -2.0)],
            [c64::new(0.0, 2.0), c64::new(1.0, 0.0)],
        ][i][j]
    });
    assert!(factor(&m).is_none());
    assert!(matches!(
        cholesky(&diagonal(&[1.0, -2.0])),
        Err(LinalgError::NotPositiveDefinite { size: 2, least: -2.0 })
    ));
}

#[test]
fn exponential_of_rotation_is_rotation() {
    let m = Matrix::from_fn(2, 2, |i, j| [[0.0, -20.0], [20.0, 0.0]][i][j]);
    let e = expm(&m).unwrap();
    let (sine, cosine) = 20.0f64.sin_cos();
    assert!(
        (e[(0, 0)] - cosine).abs() < 1e-13 && (e[(1, 0)] - sine).abs() < 1e-13,
        "{e:?}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// A similar matrix has the same eigenvalues, real ones and pairs.
    #[test]
    fn eigenvalues_of_similar_matrix_are_those_of_its_blocks(
        n in 1usize..30, pairs in 0usize..12, seed in 0u64..10_000,
    ) {
        let size = n + 2 * pairs;
        let given = matrix(1, size, seed);
        let mut blocks = Matrix::zeros(size, size);
        let mut expected = Vec::new();
        for k in 0..n {
            blocks[(k, k)] = given[(0, k)];
            expected.push(c64::new(given[(0, k)], 0.0));
        }
        for k in (n..size).step_by(2) {
            let (re, im) = (given[(0, k)], given[(0, k + 1)]);
            (blocks[(k, k)], blocks[(k + 1, k + 1)], blocks[(k, k + 1)], blocks[(k + 1, k)]) = (re, re, -im, im);
            expected.extend([c64::new(re, im), c64::new(re, -im)]);
        }
        // An orthogonal similarity, so that the eigenvalues are as well conditioned as those of a normal matrix.
        let a = matrix(size, size, seed + 1);
        let (_, q) = symmetric_eigen(&(&a + a.transpose())).unwrap();
        let m = &q * &blocks * q.transpose();
        prop_assert!(distance(&eigenvalues(&m).unwrap(), &expected) < 1e-12);
        prop_assert!(distance(&eigenvalues_complex(&to_complex(&m)).unwrap(), &expected) < 1e-12);
        let conjugates: Vec<c64> = eigenvalues(&m).unwrap().iter().map(|x| x.conj()).collect();
        prop_assert_eq!(distance(&conjugates, &eigenvalues(&m).unwrap()), 0.0, "a complex eigenvalue comes with its conjugate");
    }

    #[test]
    fn eigenvectors_are_what_matrix_only_scales(n in 1usize..25, seed in 0u64..10_000) {
        let m = matrix(n, n, seed);
        for (a, (values, vectors)) in [
            (to_complex(&m), eigen(&m).unwrap()),
            (complex(n, n, seed), eigen_complex(&complex(n, n, seed)).unwrap()),
        ] {
            let scaled = CMatrix::from_fn(n, n, |i, j| vectors[(i, j)] * values[j]);
            prop_assert!(max_abs(&(&a * &vectors - scaled)) < 1e-12);
            for j in 0..n {
                let length: f64 = (0..n).map(|i| vectors[(i, j)].norm_sqr()).sum();
                prop_assert!((length - 1.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn hermitian_decomposition_gives_matrix_back(n in 1usize..25, seed in 0u64..10_000) {
        let a = complex(n, n, seed);
        let m = &a + adjoint(&a);
        let (values, u) = hermitian_eigen(&m).unwrap();
        prop_assert!(values.is_sorted());
        let scaled = CMatrix::from_fn(n, n, |i, j| u[(i, j)] * values[j]);
        prop_assert!(max_abs(&(scaled * adjoint(&u) - m)) < 1e-12);
        prop_assert!(max_abs(&(adjoint(&u) * &u - CMatrix::identity(n, n))) < 1e-12);
    }

    #[test]
    fn singular_value_decomposition_gives_matrix_back(rows in 1usize..20, columns in 1usize..20, seed in 0u64..10_000) {
        let m = complex(rows, columns, seed);
        let (u, s, v) = svd(&m).unwrap();
        prop_assert!(s.is_sorted_by(|a, b| a >= b) && s.iter().all(|x| *x >= 0.0));
        let scaled = CMatrix::from_fn(rows, s.len(), |i, j| u[(i, j)] * s[j]);
        prop_assert!(max_abs(&(scaled * adjoint(&v) - &m)) < 1e-12);
        let alone = singular_values(&m).unwrap();
        prop_assert!(alone.iter().zip(&s).all(|(a, b)| (a - b).abs() < 1e-13));
    }

    /// Sizes below, at and above the blocks of the factorisation.
    #[test]
    fn solution_satisfies_its_equations(n in 1usize..60, columns in 1usize..6, seed in 0u64..10_000) {
        let (a, b) = (&matrix(n, n, seed) + Matrix::identity(n, n) * 3.0, matrix(n, columns, seed + 1));
        let x = solve(&a, &b).unwrap();
        prop_assert!(max_abs(&(&a * &x - &b)) < 1e-11);
        prop_assert!(max_abs(&(inverse(&a).unwrap() * &a - Matrix::identity(n, n))) < 1e-10);
        let (a, b) = (complex(n, n, seed) + CMatrix::identity(n, n) * c64::new(0.0, 3.0), complex(n, columns, seed + 1));
        prop_assert!(max_abs(&(&a * solve_complex(&a, &b) - &b)) < 1e-11);
    }

    #[test]
    fn residual_of_least_squares_is_orthogonal_to_columns(rows in 8usize..20, columns in 1usize..8, seed in 0u64..10_000) {
        let (a, b) = (matrix(rows, columns, seed), matrix(rows, 2, seed + 1));
        let x = least_squares(&a, &b);
        prop_assert!(max_abs(&(a.transpose() * (&a * x - b))) < 1e-10);
    }

    #[test]
    fn factor_of_positive_definite_matrix_gives_it_back(n in 1usize..30, seed in 0u64..10_000) {
        let a = complex(n, n, seed);
        let m = &a * adjoint(&a) + CMatrix::identity(n, n) * c64::new(0.1, 0.0);
        let l = factor(&m).unwrap();
        prop_assert!((0..n).all(|j| (0..j).all(|i| l[(i, j)] == c64::new(0.0, 0.0))));
        prop_assert!(max_abs(&(&l * adjoint(&l) - m)) < 1e-11);
    }
}
