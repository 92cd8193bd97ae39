//! Checks of the numbers of a specification or of gains against a robot and against each other, before anything is computed.

use super::file::GainTable;
use super::linearise::RobotError;
use super::sampled::is_multiple;
use super::spec::{GainStructure, SamplingSpec, Spec};
use crate::linalg::{self, LinalgError};

/// A number with its name.
type Named = (&'static str, f64);

/// Rejects the first number for which `valid` does not hold.
fn all(numbers: &[Named], valid: impl Fn(f64) -> bool, reason: &'static str) -> Result<(), RobotError> {
    match numbers.iter().find(|(_, value)| !(value.is_finite() && valid(*value))) {
        None => Ok(()),
        Some(&(what, value)) => Err(RobotError::Value {
            what: what.into(),
            value,
            reason,
        }),
    }
}

impl Spec {
    /// Checks every list and number against a robot of `n` channels.
    ///
    /// # Errors
    /// The first error found.
    pub fn check(&self, n: usize) -> Result<(), RobotError> {
        self.check_lists(n)?;
        self.sampling.check()?;
        let (w, u) = (&self.weights, &self.uncertainty);
        all(
            &[
                ("weights.peak", w.peak),
                ("weights.floor", w.floor),
                ("weights.effort", w.effort),
                ("uncertainty.multiplicative_low", u.multiplicative_low),
                ("uncertainty.multiplicative_high", u.multiplicative_high),
                ("uncertainty.multiplicative_cutoff_rad_s", u.multiplicative_cutoff_rad_s),
            ],
            |value| value > 0.0,
            "must be positive",
        )?;
        all(
            &[("uncertainty.parametric", u.parametric)],
            |value| value > 0.0 && value < 1.0,
            "must be above 0 and below 1, which would allow a mass of zero",
        )?;
        all(
            &[("search.starts", self.search.starts as f64)],
            |value| value >= 1.0,
            "at least one start is needed",
        )?;
        all(
            &[("models", self.models.len() as f64)],
            |value| value >= 1.0,
            "at least one model is needed",
        )
    }

    fn check_lists(&self, n: usize) -> Result<(), RobotError> {
        let lists: [(&'static str, &[f64]); 5] = [
            ("scales.velocity", &self.scales.velocity),
            ("scales.authority", &self.scales.authority),
            ("scales.disturbance", &self.scales.disturbance),
            ("weights.cutoff_rad_s", &self.weights.cutoff_rad_s),
            ("gains.start_kp", &self.gains.start_kp),
        ];
        let mut checked = lists.to_vec();
        if self.gains.integral {
            checked.push(("gains.start_ki", &self.gains.start_ki));
        }
        for (what, list) in checked {
            if list.len() != n {
                return Err(RobotError::Length {
                    what,
                    found: list.len(),
                    expected: n,
                });
            }
            // Start gains are checked by the tuner, with its own message, because they are matrices there.
            if !what.starts_with("gains") {
                let numbers: Vec<Named> = list.iter().map(|value| (what, *value)).collect();
                all(&numbers, |value| value > 0.0, "must be positive")?;
            }
        }
        Ok(())
    }
}

impl SamplingSpec {
    fn check(&self) -> Result<(), RobotError> {
        let (controller, plant) = (self.controller_period_s, self.plant_period_s);
        all(
            &[
                ("sampling.controller_period_s", controller),
                ("sampling.plant_period_s", plant),
            ],
            |value| value > 0.0,
            "a period must be positive",
        )?;
        all(
            &[
                ("sampling.computing_s", self.computing_s),
                ("sampling.sensor_delay_s", self.sensor_delay_s),
                ("sampling.actuator_delay_s", self.actuator_delay_s),
                ("sampling.actuator_lag_s", self.actuator_lag_s),
            ],
            |value| value >= 0.0,
            "a time must be zero or positive",
        )?;
        all(
            &[("sampling.controller_period_s", controller)],
            |value| is_multiple(value, plant),
            "must be a whole multiple of sampling.plant_period_s",
        )
    }
}

impl GainTable {
    /// Checks the gains, with or without an integral part, against a robot of `n` channels.
    ///
    /// # Errors
    /// The first error found.
    pub fn check(&self, n: usize, integral: bool) -> Result<(), RobotError> {
        let length = |what, found, expected| match found == expected {
            true => Ok(()),
            false => Err(RobotError::Length { what, found, expected }),
        };
        let positive = |what, list: &[f64]| {
            let numbers: Vec<Named> = list.iter().map(|value| (what, *value)).collect();
            all(&numbers, |value| value > 0.0, "a gain must be positive")
        };
        if integral {
            length("gains.ki", self.ki.len(), n)?;
        } else if let Some(value) = self.ki.first() {
            let reason = "the specification has no integral part (gains.integral = false)";
            all(&[("gains.ki", *value)], |_| false, reason)?;
        }
        positive("gains.ki", &self.ki)?;
        let (what, row, rows) = match self.structure {
            GainStructure::Diagonal => {
                length("gains.kp", self.kp.len(), n)?;
                return positive("gains.kp", &self.kp);
            }
            GainStructure::Block | GainStructure::Full => {
                ("gains.kp_matrix", "a row of gains.kp_matrix", &self.kp_matrix)
            }
            GainStructure::Scheduled => ("gains.x", "a row of gains.x", &self.x),
        };
        length(what, rows.len(), n)?;
        rows.iter().try_for_each(|entries| length(row, entries.len(), n))?;
        let matrix = linalg::from_rows(rows)?;
        let size = linalg::max_abs(&matrix);
        for i in 0..n {
            let asymmetric = |j: &usize| (matrix[(i, *j)] - matrix[(*j, i)]).abs() > 1e-9 * size;
            if let Some(j) = (0..i).find(asymmetric) {
                return Err(RobotError::Value {
                    what: format!("{what}[{i}][{j}]"),
                    value: matrix[(i, j)],
                    reason: "the matrix is not symmetric",
                });
            }
        }
        match linalg::cholesky(&matrix) {
            Err(LinalgError::NotPositiveDefinite { least, .. }) => Err(RobotError::Value {
                what: format!("{what}: least eigenvalue"),
                value: least,
                reason: "the matrix must be positive definite",
            }),
            other => Ok(other.map(|_| ())?),
        }
    }
}
