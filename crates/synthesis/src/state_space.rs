//! Linear time-invariant systems in state space.

use crate::balance;
use crate::linalg::{self, CMatrix, LinalgError, Matrix, c64};

/// `ẋ = A x + B u`, `y = C x + D u`, continuous time.
///
/// Shapes: A n × n, B n × m, C p × n, D p × m; n = 0 is a static gain. Units are the caller's.
#[derive(Debug, Clone, PartialEq)]
pub struct StateSpace {
    /// State matrix, n × n.
    pub a: Matrix,
    /// Input matrix, n × m.
    pub b: Matrix,
    /// Output matrix, p × n.
    pub c: Matrix,
    /// Feedthrough, p × m.
    pub d: Matrix,
}

/// Errors of forming or evaluating a system.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum ModelError {
    /// Matrices with inconsistent shapes.
    #[error("matrix {name} is {rows} x {columns}, expected {expected_rows} x {expected_columns}")]
    Shape {
        /// Name of the matrix.
        name: &'static str,
        /// Rows found.
        rows: usize,
        /// Columns found.
        columns: usize,
        /// Rows expected.
        expected_rows: usize,
        /// Columns expected.
        expected_columns: usize,
    },
    /// A transfer function with more zeros than poles has no state-space form.
    #[error("improper weight: numerator of degree {numerator}, denominator of degree {denominator}")]
    Improper {
        /// Degree of the numerator.
        numerator: usize,
        /// Degree of the denominator.
        denominator: usize,
    },
    /// A transfer function with a zero or missing leading denominator coefficient.
    #[error("the leading denominator coefficient is {0}; it must be finite and not zero")]
    LeadingCoefficient(f64),
    /// A matrix computation failed.
    #[error(transparent)]
    Linalg(#[from] LinalgError),
}

impl StateSpace {
    /// A system from its four matrices.
    ///
    /// # Errors
    /// Shapes that do not fit, entries that are not finite.
    pub fn new(a: Matrix, b: Matrix, c: Matrix, d: Matrix) -> Result<Self, ModelError> {
        let n = a.nrows();
        let shape = |name, m: &Matrix, rows, columns| {
            if m.nrows() == rows && m.ncols() == columns {
                Ok(linalg::check_finite(m)?)
            } else {
                Err(ModelError::Shape {
                    name,
                    rows: m.nrows(),
                    columns: m.ncols(),
                    expected_rows: rows,
                    expected_columns: columns,
                })
            }
        };
        shape("A", &a, n, n)?;
        shape("D", &d, d.nrows(), d.ncols())?;
        shape("B", &b, n, d.ncols())?;
        shape("C", &c, d.nrows(), n)?;
        Ok(Self { a, b, c, d })
    }

    /// A static gain.
    pub fn gain(d: Matrix) -> Self {
        let (p, m) = (d.nrows(), d.ncols());
        Self {
            a: Matrix::zeros(0, 0),
            b: Matrix::zeros(0, m),
            c: Matrix::zeros(p, 0),
            d,
        }
    }

    /// A scalar transfer function, coefficients in falling powers of s, in controllable canonical form.
    ///
    /// # Errors
    /// [`ModelError::Improper`] when the numerator's degree exceeds the denominator's.
    pub fn transfer_function(numerator: &[f64], denominator: &[f64]) -> Result<Self, ModelError> {
        let lead = denominator.first().copied().unwrap_or(0.0);
        if lead == 0.0 || !lead.is_finite() {
            return Err(ModelError::LeadingCoefficient(lead));
        }
        let skip = numerator.iter().take_while(|&&x| x == 0.0).count();
        let numerator = &numerator[skip..];
        if numerator.len() > denominator.len() {
            let (numerator, denominator) = (numerator.len() - 1, denominator.len() - 1);
            return Err(ModelError::Improper { numerator, denominator });
        }
        let n = denominator.len() - 1;
        let den: Vec<f64> = denominator[1..].iter().map(|x| x / lead).collect();
        let mut num = vec![0.0; n + 1 - numerator.len()];
        num.extend(numerator.iter().map(|x| x / lead));
        let d = num[0];
        let a = Matrix::from_fn(n, n, |i, j| {
            if i == 0 {
                -den[j]
            } else {
                f64::from(u8::from(i == j + 1))
            }
        });
        let b = Matrix::from_fn(n, 1, |i, _| f64::from(u8::from(i == 0)));
        let c = Matrix::from_fn(1, n, |_, j| num[j + 1] - d * den[j]);
        Self::new(a, b, c, Matrix::from_fn(1, 1, |_, _| d))
    }

    /// Number of states.
    pub fn states(&self) -> usize {
        self.a.nrows()
    }

    /// Number of inputs.
    pub fn inputs(&self) -> usize {
        self.d.ncols()
    }

    /// Number of outputs.
    pub fn outputs(&self) -> usize {
        self.d.nrows()
    }

    /// The same transfer matrix in scaled state coordinates, so that A, B and C are of comparable size per state.
    pub fn balanced(&self) -> StateSpace {
        let g = self;
        let n = g.states();
        let row = |i: usize| (0..g.inputs()).map(|j| g.b[(i, j)].abs()).sum::<f64>();
        let column = |i: usize| (0..g.outputs()).map(|j| g.c[(j, i)].abs()).sum::<f64>();
        let t = balance::scalings(n, |i, j| g.a[(i, j)].abs(), row, column);
        StateSpace {
            a: Matrix::from_fn(n, n, |i, j| g.a[(i, j)] * t[j] / t[i]),
            b: Matrix::from_fn(n, g.inputs(), |i, j| g.b[(i, j)] / t[i]),
            c: Matrix::from_fn(g.outputs(), n, |i, j| g.c[(i, j)] * t[j]),
            d: g.d.clone(),
        }
    }

    /// The eigenvalues of A, after balancing.
    ///
    /// # Errors
    /// No convergence of the eigenvalue iteration.
    pub fn poles(&self) -> Result<Vec<c64>, LinalgError> {
        linalg::eigenvalues(&balance::balanced(&self.a))
    }

    /// The largest real part of the poles, `-∞` for a static gain.
    ///
    /// # Errors
    /// No convergence of the eigenvalue iteration.
    pub fn spectral_abscissa(&self) -> Result<f64, LinalgError> {
        Ok(self.poles()?.iter().map(|p| p.re).fold(f64::NEG_INFINITY, f64::max))
    }

    /// `G(s) = D + C (s I − A)⁻¹ B`, p × m. At a pole the entries are not finite.
    pub fn evaluate(&self, s: c64) -> CMatrix {
        let x = linalg::solve_complex(&shifted(&self.a, s), &linalg::to_complex(&self.b));
        linalg::to_complex(&self.c) * x + linalg::to_complex(&self.d)
    }

    /// `G(jω)`, ω in rad per unit of time; an infinite ω gives D.
    pub fn at(&self, omega: f64) -> CMatrix {
        if omega.is_infinite() {
            linalg::to_complex(&self.d)
        } else {
            self.evaluate(c64::new(0.0, omega))
        }
    }

    /// The rows `outputs` and columns `inputs` of the transfer matrix, with the same states.
    pub fn select(&self, outputs: std::ops::Range<usize>, inputs: std::ops::Range<usize>) -> Self {
        let n = self.states();
        Self {
            a: self.a.clone(),
            b: self.b.block(0, inputs.start, n, inputs.len()),
            c: self.c.block(outputs.start, 0, outputs.len(), n),
            d: self.d.block(outputs.start, inputs.start, outputs.len(), inputs.len()),
        }
    }

    /// The same transfer matrix with every output multiplied by `left[i]` and every input by `right[j]`.
    pub fn scaled(&self, left: &[f64], right: &[f64]) -> Self {
        let n = self.states();
        Self {
            a: self.a.clone(),
            b: Matrix::from_fn(n, self.inputs(), |i, j| self.b[(i, j)] * right[j]),
            c: Matrix::from_fn(self.outputs(), n, |i, j| left[i] * self.c[(i, j)]),
            d: Matrix::from_fn(self.outputs(), self.inputs(), |i, j| {
                left[i] * self.d[(i, j)] * right[j]
            }),
        }
    }

    /// The transposed system, with transfer matrix `G(s)ᵀ`.
    pub fn dual(&self) -> Self {
        let t = |m: &Matrix| m.transpose();
        Self {
            a: t(&self.a),
            b: t(&self.c),
            c: t(&self.b),
            d: t(&self.d),
        }
    }

    /// The uncontrollable (`left = true`) or unobservable (`left = false`) modes that are not in the open left half-plane,
    /// by the rank test of Popov, Belevitch and Hautus.
    ///
    /// # Errors
    /// No convergence of an eigenvalue or singular-value iteration.
    pub fn fixed_unstable_modes(&self, left: bool) -> Result<Vec<c64>, LinalgError> {
        let n = self.states();
        let system = if left { self.clone() } else { self.dual() };
        let scale = linalg::max_abs(&system.a)
            .max(linalg::max_abs(&system.b))
            .max(f64::MIN_POSITIVE);
        let mut fixed = Vec::new();
        for pole in system.poles()? {
            if pole.re < 0.0 || pole.im < 0.0 {
                continue;
            }
            let pencil = CMatrix::from_fn(n, n + system.inputs(), |i, j| {
                if j < n {
                    let shift = if i == j { pole } else { c64::new(0.0, 0.0) };
                    c64::new(system.a[(i, j)], 0.0) - shift
                } else {
                    c64::new(system.b[(i, j - n)], 0.0)
                }
            });
            let least = linalg::singular_values(&pencil)?[n - 1];
            if least <= 1e-11 * scale * n as f64 {
                fixed.push(pole);
            }
        }
        Ok(fixed)
    }
}

/// `s I − a`.
pub(crate) fn shifted(a: &Matrix, s: c64) -> CMatrix {
    CMatrix::from_fn(a.nrows(), a.nrows(), |i, j| {
        let diagonal = if i == j { s } else { c64::new(0.0, 0.0) };
        diagonal - c64::new(a[(i, j)], 0.0)
    })
}
