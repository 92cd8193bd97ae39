//! What lockstep costs on this machine, as ratios measured side by side in one run.

mod deaths;
mod exchange;
mod participants;
mod scaling;
mod share;

pub use deaths::deaths;
pub use exchange::{be_an_end, exchange};
pub use participants::{factory, scenario_text};
pub use scaling::scaling;
pub use share::share;

/// Sorted figures of repeated measurements.
#[derive(Debug, Clone, Default)]
pub struct Figures(Vec<f64>);

impl Figures {
    /// Adds one.
    pub fn add(&mut self, figure: f64) {
        let at = self.0.partition_point(|&other| other < figure);
        self.0.insert(at, figure);
    }

    /// The figure below which `percent` of all lie.
    pub fn percentile(&self, percent: usize) -> f64 {
        let last = self.0.len().saturating_sub(1);
        self.0.get(last * percent / 100).copied().unwrap_or(f64::NAN)
    }

    /// The middle one.
    pub fn median(&self) -> f64 {
        self.percentile(50)
    }
}
