//! The sample that every activation of a consumer reads, computed before the run.

use serde::{Deserialize, Serialize};

use super::{DeliveryRule, Hold};
use crate::time::{SampleTime, Ticks};

/// What an input sees at a communication point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Read {
    /// No sample is visible yet, or the hold requires it: the link's initial value.
    Initial,
    /// The sample with this index.
    Sample(u64),
    /// The interpolation between the samples with these two indices.
    Between(u64, u64),
}

impl Read {
    /// The samples that it needs, in order.
    pub fn samples(self) -> impl Iterator<Item = u64> {
        let (first, second) = match self {
            Read::Initial => (None, None),
            Read::Sample(index) => (Some(index), None),
            Read::Between(before, after) => (Some(before), Some(after)),
        };
        first.into_iter().chain(second)
    }
}

/// The reads of one link, activation by activation. Producer and consumer each run one: the producer to know which samples a consumer
/// will ever read, the consumer to know which one to wait for. It holds no data and depends only on the plan.
#[derive(Debug, Clone)]
pub struct ReadSchedule {
    delivery: DeliveryRule,
    /// The least and the largest delay of the link, ticks.
    delays: (Ticks, Ticks),
    /// Every sample arrives, and all have the same delay: the read is the newest sample of an instant.
    has_constant_delay: bool,
    /// That sample of the last activation, and the instant of the next one.
    reached: Option<(u64, Ticks)>,
    consumer: SampleTime,
    /// Read sample 0 while nothing is visible.
    first_sample: bool,
    /// The next activation of [`ReadSchedule::advance`].
    next: u64,
    /// Samples up to here (exclusive) are settled: they are visible, or permanently dropped.
    settled: u64,
    /// The newest settled sample that is visible, and the newest settled sample.
    newest: Option<u64>,
    newest_sent: Option<u64>,
}

impl ReadSchedule {
    /// The schedule of a link for a consumer with sample time `consumer`. With `first_sample`, the producer's sample 0 is read while
    /// nothing is visible; that is allowed only for outputs that exist before the run starts.
    pub fn new(delivery: DeliveryRule, consumer: SampleTime, first_sample: bool) -> ReadSchedule {
        let delays = delivery.delay_bounds();
        ReadSchedule {
            has_constant_delay: delays.0 == delays.1 && !delivery.may_drop(),
            reached: None,
            delivery,
            delays,
            consumer,
            first_sample,
            next: 0,
            settled: 0,
            newest: None,
            newest_sent: None,
        }
    }

    /// The next activation that [`ReadSchedule::advance`] computes.
    pub fn next_activation(&self) -> u64 {
        self.next
    }

    /// What the consumer reads at its next activation. Constant time on average: every sample is settled once.
    pub fn advance(&mut self) -> Read {
        let t = self.consumer.instant(self.next);
        self.next += 1;
        self.read_at(t)
    }

    /// Jumps to activation `k` (forward only), for a participant that is substituted during the run.
    pub fn skip_to(&mut self, k: u64) {
        self.next = self.next.max(k);
    }

    fn read_at(&mut self, t: Ticks) -> Read {
        let (least, most) = self.delays;
        if self.has_constant_delay {
            let newest = self.newest_until(t.saturating_sub(least));
            return newest.map_or_else(|| self.initial_read(), |newest| self.read_from(newest, t));
        }
        let producer = self.delivery.producer();
        // No sample beyond `last` can be visible; every sample up to `settled_end` is, unless it is dropped.
        let Some(last) = producer.index_at_or_before(t.saturating_sub(least)) else {
            return self.initial_read();
        };
        let settled_end = producer
            .index_at_or_before(t.saturating_sub(most))
            .map_or(0, |index| index + 1);
        if settled_end > self.settled {
            self.settle(settled_end);
        }
        let late = (self.settled..=last)
            .rev()
            .find(|&k| producer.instant(k) + self.delivery.delay(k) <= t && self.counts_as_newest(k));
        let newest_sent = late.or(self.newest_sent);
        match self.delivery.hold() {
            Hold::Last | Hold::Linear => {
                let newest = late.or(self.newest);
                newest.map_or_else(|| self.initial_read(), |newest| self.read_from(newest, t))
            }
            Hold::Initial => match newest_sent {
                Some(k) if !self.delivery.is_dropped(k) => Read::Sample(k),
                Some(_) => Read::Initial,
                None => self.initial_read(),
            },
        }
    }

    /// The newest sample at or before `t`, which is never earlier than in the call before. Unless the producer is much faster, it is the
    /// same sample or the next one, and needs no division.
    #[inline]
    fn newest_until(&mut self, t: Ticks) -> Option<u64> {
        let producer = self.delivery.producer();
        let newest = match self.reached {
            Some((index, next)) if t < next => return Some(index),
            Some((index, next)) if t.abs_diff(next) < producer.period.unsigned_abs() => index + 1,
            _ => producer.index_at_or_before(t)?,
        };
        self.reached = Some((newest, producer.instant(newest + 1)));
        Some(newest)
    }

    /// What is read at `t` where sample `k` is the newest one.
    fn read_from(&self, k: u64, t: Ticks) -> Read {
        let after = (self.delivery.hold() == Hold::Linear).then(|| self.delivery.interpolation_target(k, t));
        after.flatten().map_or(Read::Sample(k), |after| Read::Between(k, after))
    }

    /// Whether sample `k` counts in the search for the newest: under `Hold::Initial` a dropped sample does, as a gap.
    fn counts_as_newest(&self, k: u64) -> bool {
        self.delivery.hold() == Hold::Initial || !self.delivery.is_dropped(k)
    }

    fn settle(&mut self, settled_end: u64) {
        // Only the newest of the newly settled samples matters; look backwards from the end.
        if let Some(found) = (self.settled..settled_end)
            .rev()
            .find(|&k| !self.delivery.is_dropped(k))
        {
            self.newest = Some(found);
        }
        self.newest_sent = Some(settled_end - 1);
        self.settled = settled_end;
    }

    fn initial_read(&self) -> Read {
        if self.first_sample {
            Read::Sample(0)
        } else {
            Read::Initial
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fault::{FaultWindow, LinkFault};
    use crate::link::Timing;
    use crate::time::{Rational, Timebase};
    use proptest::prelude::*;

    /// A direct implementation of the rule, which tests every sample.
    fn read_by_search(delivery: &DeliveryRule, t: Ticks, first_sample: bool) -> Read {
        let arrived = |k: &u64| delivery.producer().instant(*k) + delivery.delay(*k) <= t;
        let sent = (0..200).rev().filter(arrived);
        let newest = match delivery.hold() {
            Hold::Last | Hold::Linear => sent.clone().find(|&k| !delivery.is_dropped(k)),
            Hold::Initial => match sent.clone().next() {
                Some(k) if delivery.is_dropped(k) => return Read::Initial,
                other => other,
            },
        };
        match newest {
            Some(k) if delivery.hold() == Hold::Linear => {
                // The next sample that is not lost, if it has arrived by `t` without the delay and was taken before.
                let mut undelayed = delivery.clone();
                undelayed.clear_fixed_delay();
                let there = |next: &u64| {
                    delivery.producer().instant(*next) < t && has_arrived_without_delay(&undelayed, *next, t)
                };
                let next = (k + 1..400).find(|&next| !delivery.is_dropped(next)).filter(there);
                let between = next.filter(|_| delivery.weight(t, k, k + 1) > 0.0);
                between.map_or(Read::Sample(k), |next| Read::Between(k, next))
            }
            Some(k) => Read::Sample(k),
            None if first_sample => Read::Sample(0),
            None => Read::Initial,
        }
    }

    fn has_arrived_without_delay(undelayed: &DeliveryRule, k: u64, t: Ticks) -> bool {
        undelayed.producer().instant(k) + undelayed.delay(k) <= t
    }

    proptest! {
        #[test]
        fn read_schedule_equals_exhaustive_search(
            (offset, period, consumer_offset, consumer_period) in (0_i64..30, 1_i64..20, 0_i64..30, 1_i64..25),
            (delay, delay_parts, jitter) in (0_i64..100, 1_i64..7, 0_i64..60),
            drop in prop_oneof![Just(0.0), Just(1.0), 0.0..1.0],
            faults in prop::collection::vec(
                (0_i64..800, prop_oneof![Just(None), (0_i64..300).prop_map(Some)], prop_oneof![Just(0.0), 0.0..=1.0], 0_i64..90, 1_i64..7),
                0..4,
            ),
            hold in prop_oneof![Just(Hold::Last), Just(Hold::Initial), Just(Hold::Linear)],
            first_sample in any::<bool>(),
            seed in any::<u64>(),
        ) {
            let timebase = Timebase::from_times([Rational::from_millis(1)]).unwrap();
            let timing = Timing {
                delay: Rational::new(i128::from(delay), i128::from(delay_parts) * 1000).unwrap(),
                jitter: Rational::from_millis(jitter),
                drop,
                hold,
            };
            let fault = |(number, (at, length, drop, extra, parts)): (usize, &(i64, Option<i64>, f64, i64, i64))| LinkFault {
                name: format!("f{number}"),
                span: FaultWindow {
                    at: Rational::from_millis(*at),
                    until: length.map(|length| Rational::from_millis(at + length)),
                },
                drop: *drop,
                extra_delay: Rational::new(i128::from(*extra), i128::from(*parts) * 1000).unwrap(),
                description: String::new(),
            };
            let faults: Vec<LinkFault> = faults.iter().enumerate().map(fault).collect();
            let producer = SampleTime { offset, period };
            let delivery = DeliveryRule::new(&timing, &faults, producer, &timebase, seed, "x").unwrap();
            let consumer = SampleTime { offset: consumer_offset, period: consumer_period };
            let mut schedule = ReadSchedule::new(delivery.clone(), consumer, first_sample);
            let mut last = 0;
            for k in 0..consumer.count_before(200 * period.min(5)) {
                let read = schedule.advance();
                prop_assert_eq!(read, read_by_search(&delivery, consumer.instant(k), first_sample), "activation {}", k);
                if let Some(index) = read.samples().next() {
                    prop_assert!(index >= last, "reads never go back");
                    last = index;
                }
                if let Read::Between(before, after) = read {
                    let weight = delivery.weight(consumer.instant(k), before, after);
                    prop_assert!(0.0 < weight && weight < 1.0, "{}", weight);
                    let seconds = |tick: Ticks| tick as f64 / 1000.0;
                    let now = seconds(consumer.instant(k)) - timing.delay.seconds();
                    let (from, to) = (seconds(producer.instant(before)), seconds(producer.instant(after)));
                    prop_assert!((from + weight * (to - from) - now).abs() < 1e-12);
                }
            }
        }

        #[test]
        fn link_fault_affects_only_samples_within_its_window(
            (at, length) in (0_i64..60, 0_i64..60),
            (delay, extra, parts) in (0_i64..40, 0_i64..40, 1_i64..7),
            (before, drop) in (prop_oneof![Just(0.0), 0.0..1.0], prop_oneof![Just(0.0), Just(1.0), 0.0..1.0]),
            seed in any::<u64>(),
        ) {
            let timebase = Timebase::from_times([Rational::from_millis(1)]).unwrap();
            let producer = SampleTime { offset: 3, period: 2 };
            let thirds = |n: i64| Rational::new(i128::from(n), 3000).unwrap();
            let timing = Timing { delay: thirds(delay), drop: before, ..Timing::default() };
            let fault = LinkFault {
                name: "f".into(),
                span: FaultWindow { at: thirds(at), until: Some(thirds(at + length)) },
                drop,
                extra_delay: Rational::new(i128::from(extra), i128::from(parts) * 1000).unwrap(),
                description: String::new(),
            };
            let rule = |faults: &[LinkFault]| DeliveryRule::new(&timing, faults, producer, &timebase, seed, "x").unwrap();
            let (healthy, faulty) = (rule(&[]), rule(std::slice::from_ref(&fault)));
            prop_assert_eq!(faulty.delay_bounds().0, healthy.delay_bounds().0, "no loop is opened, none is made");
            for k in 0..60 {
                let stamp = 3 * producer.instant(k);
                if stamp < at || stamp >= at + length {
                    prop_assert_eq!(faulty.delay(k), healthy.delay(k));
                    prop_assert_eq!(faulty.is_dropped(k), healthy.is_dropped(k));
                    continue;
                }
                let late = timing.delay.seconds() + fault.extra_delay.seconds();
                let ticks = faulty.delay(k) as f64;
                prop_assert!((late * 1000.0 - 1e-9..late * 1000.0 + 1.0).contains(&ticks), "{} {}", late, ticks);
                prop_assert!(ticks <= faulty.delay_bounds().1 as f64);
                prop_assert!(faulty.is_dropped(k) >= healthy.is_dropped(k));
                prop_assert!(drop < 1.0 || faulty.is_dropped(k));
                prop_assert!(drop > 0.0 || faulty.is_dropped(k) == healthy.is_dropped(k));
            }
        }

        #[test]
        fn delay_stays_within_exact_bounds(
            (delay, jitter, parts) in (0_i128..1_000_000, 0_i128..1_000_000, 1_i128..1000),
            seed in any::<u64>(),
        ) {
            let timebase = Timebase::from_times([Rational::new(1, 300).unwrap(), Rational::from_millis(1)]).unwrap();
            let timing = Timing {
                delay: Rational::new(delay, parts * 1000).unwrap(),
                jitter: Rational::new(jitter, parts * 777).unwrap(),
                ..Timing::default()
            };
            let producer = SampleTime { offset: 0, period: 10 };
            let delivery = DeliveryRule::new(&timing, &[], producer, &timebase, seed, "x").unwrap();
            let (least, most) = delivery.delay_bounds();
            prop_assert_eq!(least, timebase.ceil(timing.delay).unwrap());
            for k in 0..50 {
                prop_assert!((least..=most).contains(&delivery.delay(k)));
            }
        }
    }
}
