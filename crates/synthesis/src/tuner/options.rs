//! Options of the tuner, and its progress reports.

/// Options of the tuner.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// Number of starts; the first is the start value of the gains, the others are scattered around it. If the full state is
    /// measured one more follows, from the Riccati equation.
    pub starts: usize,
    /// Standard deviation of that scatter: of a logarithm for positive gains, of a parameter unit for full ones.
    pub scatter: f64,
    /// Seed of the scatter and of the sampling for the certificate.
    pub seed: u64,
    /// BFGS iterations per descent.
    pub iterations: usize,
    /// Evaluations per finishing phase.
    pub finishing: usize,
    /// Rounds of descent and finishing.
    pub rounds: usize,
    /// Relative gain below which a phase ends.
    pub tolerance: f64,
    /// Whether to compute the certificate, which costs a hundred evaluations.
    pub certify: bool,
    /// Threads that share the starts and the models; has no influence on the result.
    pub threads: usize,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            starts: 3,
            scatter: 1.0,
            seed: 1,
            iterations: 300,
            finishing: 60,
            rounds: 3,
            tolerance: 1e-5,
            certify: true,
            threads: 2,
        }
    }
}

/// Phase of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Looking for a stabilising gain.
    Stabilise,
    /// BFGS.
    Descend,
    /// Bundle.
    Finish,
}

/// One line of progress.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TuningProgress {
    /// Number of the start, from 0.
    pub start: usize,
    /// Its phase.
    pub phase: Phase,
    /// The abscissa while stabilising, gamma afterwards.
    pub value: f64,
    /// Smallest gamma of this start so far; infinite before the first stabilising gain.
    pub best: f64,
}

/// Whether to continue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SearchControl {
    /// Continue.
    Continue,
    /// Stop soon and report the best gains so far.
    Stop,
}
