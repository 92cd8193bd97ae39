//! The number of samples that a link must be able to hold.

use super::PlanError;
use super::limits::CAPACITY_MAX;
use crate::link::Visibility;
use crate::time::SampleTime;

/// The room for samples in flight, so that a producer that waits for room always waits for a consumer that is behind it in simulated
/// time.
///
/// Let the consumer stand at its activation t, waiting for something else, with the queue of this link full. The queue
/// holds samples that some activation at or after t reads; the second of them is not visible at t, so it is stamped after t - d, d the
/// largest delay. With capacity B the sample that finds no room is stamped at least (B - 1) P after that. For (B - 1) P >= d + 2 P its
/// producer, which works on it at most one period before the stamp, stands after t. So waiting for room leads strictly back in time;
/// waiting for a sample leads back in time or, at one instant, to a lower rank. There is no circle.
pub(super) fn capacity(link: &str, visibility: &Visibility, consumer: SampleTime) -> Result<usize, PlanError> {
    let (_, delay) = visibility.delay_bounds();
    let period = i128::from(visibility.producer().period);
    // The consumer's lag within one of its own periods does not enter the argument, but a buffer for two of them lets the producer work
    // on while the consumer computes.
    let lag = 2 * i128::from(consumer.period) / period.max(1);
    let needed = (i128::from(delay) / period + 4) as u128;
    if needed > CAPACITY_MAX {
        return Err(PlanError::Capacity {
            link: link.to_owned(),
            samples: needed,
        });
    }
    Ok((needed + (lag as u128).min(64)).min(CAPACITY_MAX) as usize)
}
