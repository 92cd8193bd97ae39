//! Joints that follow others (mimic joints): an exact coordinate reduction.
//!
//! All positions are `q = G q_r + g` of the joint coordinates `q_r`, with a constant matrix G of multipliers, and all velocities
//! `ν = G ν_r`. Virtual work then gives the equations of motion in `q_r` from those of the tree in which every joint is free:
//! `Gᵀ M G`, `Gᵀ C G`, `Gᵀ τ`, and `J G` for a Jacobian. G is constant and has no derivative: `Gᵀ C ν` is the bias force, and
//! `Ṁ − 2C` stays skew.

use crate::description::JointCoupling;
use crate::num::Real;
use std::borrow::Cow;

/// The columns that G sums, for velocities that start with `offset` base components.
#[derive(Clone, Copy)]
pub(crate) struct CoordinateReduction<'a> {
    pub couplings: Option<&'a [JointCoupling]>,
    pub offset: usize,
}

impl CoordinateReduction<'_> {
    /// Number of joint coordinates of `joints` joints.
    pub(crate) fn coordinates(&self, joints: usize) -> usize {
        self.couplings.map_or(joints, |couplings| {
            couplings
                .iter()
                .map(|coupling| coupling.coordinate + 1)
                .max()
                .unwrap_or(0)
        })
    }

    /// Row of the reduced velocity and factor, for a row of the full one.
    fn reduced_row(&self, row: usize) -> (usize, f64) {
        match self.couplings {
            Some(couplings) if row >= self.offset => {
                let coupling = &couplings[row - self.offset];
                (self.offset + coupling.coordinate, coupling.multiplier)
            }
            _ => (row, 1.0),
        }
    }

    /// All joint positions.
    pub(crate) fn positions<'q, T: Real>(&self, q: &'q [T]) -> Cow<'q, [T]> {
        match self.couplings {
            None => Cow::Borrowed(q),
            Some(couplings) => {
                let one = |coupling: &JointCoupling| {
                    q[coupling.coordinate] * T::of(coupling.multiplier) + T::of(coupling.offset)
                };
                Cow::Owned(couplings.iter().map(one).collect())
            }
        }
    }

    /// All velocities, or accelerations.
    pub(crate) fn velocities<'v>(&self, nu: &'v [f64]) -> Cow<'v, [f64]> {
        match self.couplings {
            None => Cow::Borrowed(nu),
            Some(couplings) => {
                let rows = 0..self.offset + couplings.len();
                Cow::Owned(
                    rows.map(|row| self.reduced_row(row))
                        .map(|(at, factor)| factor * nu[at])
                        .collect(),
                )
            }
        }
    }

    /// `x G` of a matrix with `rows` rows, column by column.
    pub(crate) fn columns<T: Real>(&self, rows: usize, x: Vec<T>) -> Vec<T> {
        let Some(couplings) = self.couplings else { return x };
        let mut out = vec![T::of(0.0); rows * (self.offset + self.coordinates(couplings.len()))];
        for (column, values) in x.chunks(rows).enumerate() {
            let (at, factor) = self.reduced_row(column);
            for (slot, value) in out[at * rows..(at + 1) * rows].iter_mut().zip(values) {
                *slot = *slot + *value * T::of(factor);
            }
        }
        out
    }

    /// `Gᵀ x` of a vector, or of every column of a matrix with as many rows as there are velocities.
    pub(crate) fn rows<T: Real>(&self, x: Vec<T>) -> Vec<T> {
        let Some(couplings) = self.couplings else { return x };
        let (full, reduced) = (
            self.offset + couplings.len(),
            self.offset + self.coordinates(couplings.len()),
        );
        let mut out = vec![T::of(0.0); x.len() / full * reduced];
        for (values, slots) in x.chunks(full).zip(out.chunks_mut(reduced)) {
            for (row, value) in values.iter().enumerate() {
                let (at, factor) = self.reduced_row(row);
                slots[at] = slots[at] + *value * T::of(factor);
            }
        }
        out
    }

    /// `Gᵀ x G`.
    pub(crate) fn congruence<T: Real>(&self, x: Vec<T>) -> Vec<T> {
        let Some(couplings) = self.couplings else { return x };
        self.rows(self.columns(self.offset + couplings.len(), x))
    }
}
