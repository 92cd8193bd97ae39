//! The number of samples that a link must be able to hold.

use super::error::{DelayPart, PlanError};
use super::limits::CAPACITY_MAX;
use crate::fault::LinkFault;
use crate::link::{DeliveryRule, Timing};
use crate::time::SampleTime;

/// The room for samples in flight, so that a producer that waits for room always waits for a consumer that is behind it in simulated
/// time.
///
/// Let the consumer stand at its activation t, waiting for something else, with the queue of this link full. The queue
/// holds samples that some activation at or after t reads; the second of them is not visible at t, so it is stamped after t - d, d the
/// largest delay. With capacity B the sample that finds no room is stamped at least (B - 1) P after that. For (B - 1) P >= d + 2 P its
/// producer, which works on it at most one period before the stamp, stands after t. So waiting for room leads strictly back in time;
/// waiting for a sample leads back in time or, at one instant, to a lower rank. So there is no cycle.
pub(super) fn capacity(
    link: &str,
    (timing, faults): (&Timing, &[LinkFault]),
    delivery: &DeliveryRule,
    consumer: SampleTime,
) -> Result<usize, PlanError> {
    let (_, delay) = delivery.delay_bounds();
    let period = i128::from(delivery.producer().period);
    // The consumer's lag within one of its own periods does not enter the argument, but a buffer for two of them lets the producer work
    // on while the consumer computes.
    let lag = 2 * i128::from(consumer.period) / period.max(1);
    let needed = (i128::from(delay) / period + 4) as u128;
    if needed > CAPACITY_MAX {
        return Err(PlanError::Capacity {
            link: link.to_owned(),
            samples: needed,
            longest: longest_delay_part(timing, faults),
        });
    }
    Ok((needed + (lag as u128).min(64)).min(CAPACITY_MAX) as usize)
}

/// The longest part of the largest delay of a link, which is the one to be shortened.
fn longest_delay_part(timing: &Timing, faults: &[LinkFault]) -> DelayPart {
    let faults = faults.iter().map(|fault| DelayPart::Fault {
        name: fault.name.clone(),
        extra: fault.extra_delay,
    });
    // Of equal ones the last is taken.
    let others = faults.chain([DelayPart::Jitter(timing.jitter)]);
    let longest = others.max_by_key(DelayPart::time);
    let delay = DelayPart::Delay(timing.delay);
    longest.filter(|other| other.time() > delay.time()).unwrap_or(delay)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::FaultWindow;
    use crate::time::{Rational, Timebase};

    #[test]
    fn capacity_error_names_longest_part_of_delay() {
        let second = Rational::from_millis(1000);
        let hour = Rational::from_millis(3_600_000);
        let error_for = |delay: Rational, jitter: Rational, extra: Rational| {
            let timing = Timing {
                delay,
                jitter,
                ..Timing::default()
            };
            let faults = [LinkFault {
                name: "late".into(),
                span: FaultWindow {
                    at: second,
                    until: None,
                },
                drop: 0.0,
                extra_delay: extra,
                description: String::new(),
            }];
            let timebase = Timebase::from_times([Rational::from_millis(1)]).unwrap();
            let sample_time = SampleTime { offset: 0, period: 1 };
            let rule = DeliveryRule::new(&timing, &faults, sample_time, &timebase, 1, "b.u").unwrap();
            let result = capacity("link", (&timing, &faults), &rule, sample_time);
            result.unwrap_err().to_string()
        };
        for (error, part) in [
            (error_for(hour, second, second), "shorten its delay of 3600 s"),
            (error_for(second, hour, second), "shorten its jitter of 3600 s"),
            (
                error_for(second, second, hour),
                "shorten the extra delay of 3600 s of the fault `late`",
            ),
            (error_for(hour, hour, hour), "shorten its delay of 3600 s"),
        ] {
            assert!(error.contains("connection `link`") && error.contains(part), "{error}");
        }
    }
}
