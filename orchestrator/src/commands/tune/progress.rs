//! Text of a progress update of the search.

use synthesis::tuner::{Phase, TuningProgress};

/// The number of the start, its phase, and its progress.
pub fn progress_line(p: TuningProgress, starts: usize) -> String {
    let (start, value) = (p.start + 1, p.value);
    match p.phase {
        Phase::Stabilise => format!("start {start} of {starts}: stabilising, spectral abscissa {value:.4e}"),
        Phase::Descend => format!("start {start} of {starts}: descending, gamma {value:.5}"),
        Phase::Finish => format!("start {start} of {starts}: finishing, gamma {value:.5}"),
    }
}
