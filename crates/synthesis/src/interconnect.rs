//! Interconnection of state-space systems.

use crate::linalg::{self, Matrix, blocks};
use crate::state_space::StateSpace;

/// Errors of an interconnection.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum InterconnectError {
    /// Signal widths that differ.
    #[error("{what}: {found} signals meet {expected}")]
    Width {
        /// Which connection.
        what: &'static str,
        /// Width found.
        found: usize,
        /// Width expected.
        expected: usize,
    },
    /// The loop is algebraic (direct feedthrough throughout) with a gain of one: no solution exists.
    #[error("ill-posed loop: I − D₁D₂ is singular (reciprocal condition {0:.1e})")]
    IllPosed(f64),
}

fn width(what: &'static str, found: usize, expected: usize) -> Result<(), InterconnectError> {
    if found == expected {
        Ok(())
    } else {
        Err(InterconnectError::Width { what, found, expected })
    }
}

/// `second · first`: the output of `first` drives `second`.
///
/// # Errors
/// Widths that differ.
pub fn series(first: &StateSpace, second: &StateSpace) -> Result<StateSpace, InterconnectError> {
    width("series", first.outputs(), second.inputs())?;
    let zero = Matrix::zeros(first.states(), second.states());
    Ok(StateSpace {
        a: blocks(&[&[&first.a, &zero], &[&(&second.b * &first.c), &second.a]]),
        b: blocks(&[&[&first.b], &[&(&second.b * &first.d)]]),
        c: blocks(&[&[&(&second.d * &first.c), &second.c]]),
        d: &second.d * &first.d,
    })
}

/// `first + second` on the same input.
///
/// # Errors
/// Widths that differ.
pub fn parallel(first: &StateSpace, second: &StateSpace) -> Result<StateSpace, InterconnectError> {
    width("parallel inputs", first.inputs(), second.inputs())?;
    width("parallel outputs", first.outputs(), second.outputs())?;
    let (n1, n2) = (first.states(), second.states());
    Ok(StateSpace {
        a: blocks(&[
            &[&first.a, &Matrix::zeros(n1, n2)],
            &[&Matrix::zeros(n2, n1), &second.a],
        ]),
        b: blocks(&[&[&first.b], &[&second.b]]),
        c: blocks(&[&[&first.c, &second.c]]),
        d: &first.d + &second.d,
    })
}

/// Block diagonal connection: inputs, outputs and states are concatenated.
pub fn append(systems: &[StateSpace]) -> StateSpace {
    let n = systems.iter().map(StateSpace::states).sum();
    let m = systems.iter().map(StateSpace::inputs).sum();
    let p = systems.iter().map(StateSpace::outputs).sum();
    let mut out = StateSpace {
        a: Matrix::zeros(n, n),
        b: Matrix::zeros(n, m),
        c: Matrix::zeros(p, n),
        d: Matrix::zeros(p, m),
    };
    let (mut i, mut j, mut k) = (0, 0, 0);
    for g in systems {
        out.a.set_block(i, i, &g.a);
        out.b.set_block(i, j, &g.b);
        out.c.set_block(k, i, &g.c);
        out.d.set_block(k, j, &g.d);
        i += g.states();
        j += g.inputs();
        k += g.outputs();
    }
    out
}

/// Negative feedback: `u = r − H y`, `y = G u`, from r to y.
///
/// # Errors
/// Widths that differ, an algebraic loop without a solution.
pub fn feedback(g: &StateSpace, h: &StateSpace) -> Result<StateSpace, InterconnectError> {
    width("feedback: outputs of G to inputs of H", g.outputs(), h.inputs())?;
    width("feedback: outputs of H to inputs of G", h.outputs(), g.inputs())?;
    // [y; y] = [G G; G G] [r; u_H] with u_H = −H y is a lower linear fractional transformation.
    let (n, m, p) = (g.states(), g.inputs(), g.outputs());
    let plant = StateSpace {
        a: g.a.clone(),
        b: blocks(&[&[&g.b, &g.b]]),
        c: blocks(&[&[&g.c], &[&g.c]]),
        d: blocks(&[&[&g.d, &g.d], &[&g.d, &g.d]]),
    };
    debug_assert_eq!((plant.states(), plant.inputs(), plant.outputs()), (n, 2 * m, 2 * p));
    let negative = h.scaled(&vec![-1.0; h.outputs()], &vec![1.0; h.inputs()]);
    lft_lower(&plant, &negative)
}

/// Lower linear fractional transformation `F_l(P, K)`: the last outputs of P go through K to its last inputs.
///
/// # Errors
/// Widths that do not fit, an algebraic loop without a solution.
pub fn lft_lower(p: &StateSpace, k: &StateSpace) -> Result<StateSpace, InterconnectError> {
    let (ny, nu) = (k.inputs(), k.outputs());
    if ny > p.outputs() {
        return Err(InterconnectError::Width {
            what: "inputs of K",
            found: ny,
            expected: p.outputs(),
        });
    }
    if nu > p.inputs() {
        return Err(InterconnectError::Width {
            what: "outputs of K",
            found: nu,
            expected: p.inputs(),
        });
    }
    let (nz, nw) = (p.outputs() - ny, p.inputs() - nu);
    let p11 = p.select(0..nz, 0..nw);
    let p12 = p.select(0..nz, nw..nw + nu);
    let p21 = p.select(nz..nz + ny, 0..nw);
    let p22 = p.select(nz..nz + ny, nw..nw + nu);
    // y = C2 x + D21 w + D22 u, u = Ck xk + Dk y: u = E (Ck xk + Dk (C2 x + D21 w)) with E = (I − Dk D22)⁻¹.
    let loop_gain = Matrix::identity(nu, nu) - &k.d * &p22.d;
    let rcond = linalg::reciprocal_condition(&loop_gain).unwrap_or(0.0);
    if rcond < 1e-14 {
        return Err(InterconnectError::IllPosed(rcond));
    }
    let e = linalg::inverse(&loop_gain).map_err(|_| InterconnectError::IllPosed(rcond))?;
    let (ux, uk, uw) = (&e * (&k.d * &p22.c), &e * &k.c, &e * (&k.d * &p21.d));
    let (yx, yk, yw) = (&p22.c + &p22.d * &ux, &p22.d * &uk, &p21.d + &p22.d * &uw);
    Ok(StateSpace {
        a: blocks(&[
            &[&(&p.a + &p12.b * &ux), &(&p12.b * &uk)],
            &[&(&k.b * &yx), &(&k.a + &k.b * &yk)],
        ]),
        b: blocks(&[&[&(&p11.b + &p12.b * &uw)], &[&(&k.b * &yw)]]),
        c: blocks(&[&[&(&p11.c + &p12.d * &ux), &(&p12.d * &uk)]]),
        d: &p11.d + &p12.d * &uw,
    })
}
