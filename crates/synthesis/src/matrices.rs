//! A plant given as plain matrices, in the form of the static output feedback collections.

use serde::{Deserialize, Serialize};

use crate::linalg::{self, Matrix, blocks};
use crate::state_space::{ModelError, StateSpace};
use crate::tuner::{Channel, GainBlock, GainKind, Model, Problem};

/// `ẋ = A x + B1 w + B u`, `z = C1 x + D11 w + D12 u`, `y = C x + D21 w + D22 u`, to be closed by `u = K y`.
///
/// Rows of numbers, row by row. A missing D is zero. In a file the keys are `A`, `B1`, `B`, `C1`, `C`, `D11`, `D12`,
/// `D21`, `D22`, and optionally `name` and `K` (a gain to start from); other keys are ignored, so that problems from
/// published collections, which carry their own remarks, can be read as they are.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
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
