//! A plant given as plain matrices, in the form of the static output feedback collections.

use std::collections::BTreeMap;

use serde::de::IgnoredAny;
use serde::{Deserialize, Serialize};

use crate::linalg::{self, Matrix, blocks};
use crate::state_space::{ModelError, StateSpace};
use crate::tuner::{Channel, GainBlock, GainKind, Model, Problem};

/// `ẋ = A x + B1 w + B u`, `z = C1 x + D11 w + D12 u`, `y = C x + D21 w + D22 u`, to be closed by `u = K y`.
///
/// Matrices are given row by row. A missing D is zero. In a file the keys are `A`, `B1`, `B`, `C1`, `C`, `D11`, `D12`, `D21`,
/// `D22`, and optionally `name` and `K` (a start gain). The additional keys of published collections are accepted: `source` is
/// skipped, and the sizes `nx`, `nw`, `nu`, `nz`, `ny` must agree with the matrices. Every other key is an error.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "RawPlantMatrices")]
#[allow(missing_docs)]
pub struct PlantMatrices {
    #[serde(default)]
    pub name: String,
    #[serde(rename = "A")]
    pub a: Vec<Vec<f64>>,
    #[serde(rename = "B1")]
    pub b1: Vec<Vec<f64>>,
    #[serde(rename = "B")]
    pub b: Vec<Vec<f64>>,
    #[serde(rename = "C1")]
    pub c1: Vec<Vec<f64>>,
    #[serde(rename = "C")]
    pub c: Vec<Vec<f64>>,
    #[serde(rename = "D11", default)]
    pub d11: Vec<Vec<f64>>,
    #[serde(rename = "D12", default)]
    pub d12: Vec<Vec<f64>>,
    #[serde(rename = "D21", default)]
    pub d21: Vec<Vec<f64>>,
    #[serde(rename = "D22", default)]
    pub d22: Vec<Vec<f64>>,
    #[serde(rename = "K", default, skip_serializing_if = "Option::is_none")]
    pub start: Option<Vec<Vec<f64>>>,
}

/// Errors of a file of matrices.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum KeyError {
    /// An unknown key, possibly a misspelt one.
    #[error("{0}: unknown key; known are A, B1, B, C1, C, D11, D12, D21, D22, K, name, source, nx, nw, nu, nz and ny")]
    Unknown(String),
    /// A stated size that disagrees with the matrices.
    #[error("{key}: {stated} stated, but {matrix} has {found} {what}; correct one of them")]
    Size {
        /// The key.
        key: &'static str,
        /// Its value.
        stated: usize,
        /// The matrix that disagrees.
        matrix: &'static str,
        /// Rows or columns.
        what: &'static str,
        /// Their number.
        found: usize,
    },
}

/// Raw content of a file.
#[derive(Deserialize)]
struct RawPlantMatrices {
    #[serde(default)]
    name: String,
    #[serde(rename = "A")]
    a: Vec<Vec<f64>>,
    #[serde(rename = "B1")]
    b1: Vec<Vec<f64>>,
    #[serde(rename = "B")]
    b: Vec<Vec<f64>>,
    #[serde(rename = "C1")]
    c1: Vec<Vec<f64>>,
    #[serde(rename = "C")]
    c: Vec<Vec<f64>>,
    #[serde(rename = "D11", default)]
    d11: Vec<Vec<f64>>,
    #[serde(rename = "D12", default)]
    d12: Vec<Vec<f64>>,
    #[serde(rename = "D21", default)]
    d21: Vec<Vec<f64>>,
    #[serde(rename = "D22", default)]
    d22: Vec<Vec<f64>>,
    #[serde(rename = "K", default)]
    start: Option<Vec<Vec<f64>>>,
    #[serde(rename = "source", default)]
    _source: Option<IgnoredAny>,
    nx: Option<usize>,
    nw: Option<usize>,
    nu: Option<usize>,
    nz: Option<usize>,
    ny: Option<usize>,
    #[serde(flatten)]
    others: BTreeMap<String, IgnoredAny>,
}

impl TryFrom<RawPlantMatrices> for PlantMatrices {
    type Error = KeyError;

    fn try_from(l: RawPlantMatrices) -> Result<Self, KeyError> {
        if let Some(key) = l.others.into_keys().next() {
            return Err(KeyError::Unknown(key));
        }
        let width = |m: &[Vec<f64>]| m.first().map_or(0, Vec::len);
        let sizes = [
            ("nx", l.nx, "A", "rows", l.a.len()),
            ("nw", l.nw, "B1", "columns", width(&l.b1)),
            ("nu", l.nu, "B", "columns", width(&l.b)),
            ("nz", l.nz, "C1", "rows", l.c1.len()),
            ("ny", l.ny, "C", "rows", l.c.len()),
        ];
        for (key, stated, matrix, what, found) in sizes {
            if let Some(stated) = stated.filter(|n| *n != found) {
                return Err(KeyError::Size {
                    key,
                    stated,
                    matrix,
                    what,
                    found,
                });
            }
        }
        Ok(Self {
            name: l.name,
            a: l.a,
            b1: l.b1,
            b: l.b,
            c1: l.c1,
            c: l.c,
            d11: l.d11,
            d12: l.d12,
            d21: l.d21,
            d22: l.d22,
            start: l.start,
        })
    }
}

impl PlantMatrices {
    /// The generalised plant, inputs [w; u], outputs [z; y].
    ///
    /// # Errors
    /// Ragged rows, entries that are not finite, shapes that do not fit.
    pub fn plant(&self) -> Result<StateSpace, ModelError> {
        let a = linalg::from_rows(&self.a)?;
        let (b1, b) = (linalg::from_rows(&self.b1)?, linalg::from_rows(&self.b)?);
        let (c1, c) = (linalg::from_rows(&self.c1)?, linalg::from_rows(&self.c)?);
        let n = a.nrows();
        let expect = |name, m: &Matrix, rows: usize, columns: usize| {
            if (m.nrows(), m.ncols()) == (rows, columns) {
                return Ok(());
            }
            let (found_rows, found_columns) = (m.nrows(), m.ncols());
            Err(ModelError::Shape {
                name,
                rows: found_rows,
                columns: found_columns,
                expected_rows: rows,
                expected_columns: columns,
            })
        };
        let (nw, nu, nz, ny) = (b1.ncols(), b.ncols(), c1.nrows(), c.nrows());
        expect("A", &a, n, n)?;
        expect("B1", &b1, n, nw)?;
        expect("B", &b, n, nu)?;
        expect("C1", &c1, nz, n)?;
        expect("C", &c, ny, n)?;
        let feedthrough = |name, rows_of: &Vec<Vec<f64>>, rows, columns| -> Result<Matrix, ModelError> {
            if rows_of.is_empty() {
                return Ok(Matrix::zeros(rows, columns));
            }
            let m = linalg::from_rows(rows_of)?;
            expect(name, &m, rows, columns)?;
            Ok(m)
        };
        let d11 = feedthrough("D11", &self.d11, nz, nw)?;
        let d12 = feedthrough("D12", &self.d12, nz, nu)?;
        let d21 = feedthrough("D21", &self.d21, ny, nw)?;
        let d22 = feedthrough("D22", &self.d22, ny, nu)?;
        StateSpace::new(
            a,
            blocks(&[&[&b1, &b]]),
            blocks(&[&[&c1], &[&c]]),
            blocks(&[&[&d11, &d12], &[&d21, &d22]]),
        )
    }

    /// Static output feedback on this plant: one model, one channel, every entry of K free.
    ///
    /// # Errors
    /// As [`Self::plant`]; a start gain of the wrong shape.
    pub fn static_output_feedback(&self) -> Result<Problem, ModelError> {
        let plant = self.plant()?;
        let (nu, ny) = (self.b.first().map_or(0, Vec::len), self.c.len());
        let (nw, nz) = (plant.inputs() - nu, plant.outputs() - ny);
        let start = match &self.start {
            Some(rows) => linalg::from_rows(rows)?,
            None => Matrix::zeros(nu, ny),
        };
        if (start.nrows(), start.ncols()) != (nu, ny) {
            let (rows, columns) = (start.nrows(), start.ncols());
            return Err(ModelError::Shape {
                name: "K",
                rows,
                columns,
                expected_rows: nu,
                expected_columns: ny,
            });
        }
        let channel = Channel {
            name: "w to z".into(),
            outputs: 0..nz,
            inputs: 0..nw,
        };
        let name = if self.name.is_empty() {
            "plant".to_string()
        } else {
            self.name.clone()
        };
        Ok(Problem {
            models: vec![Model {
                name,
                plant,
                controls: nu,
                measurements: ny,
                channels: vec![channel],
                transforms: vec![None],
            }],
            gains: vec![GainBlock {
                name: "K".into(),
                kind: GainKind::Full { rows: nu, columns: ny },
                row: 0,
                column: 0,
                start,
                unit: 1.0,
            }],
        })
    }
}
