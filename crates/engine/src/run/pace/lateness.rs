//! How well a run keeps pace with the wall clock: how late the steps of each participant are, and which participant is the cause.

use lockstep::plan::Plan;
use lockstep::span::{Span, SpanActivity};
use lockstep::time::Ticks;

use super::clock_controller::ClockController;
use super::report::{Lateness, PaceReport};
use crate::run::options::Overrun;

/// Evaluates steps as they come.
pub(crate) struct LatenessMonitor {
    requested: f64,
    overrun: Overrun,
    participants: Vec<ParticipantLateness>,
    /// The first overrun, in words.
    first: Option<String>,
    /// The stretch of the newest step: its number, the wall time from its beginning until the newest instant with a step was due,
    /// and how late a step at that instant was, s.
    newest: (u64, f64, f64),
    /// The sums of these two times over the earlier stretches, s.
    before: (f64, f64),
}

/// The data of one participant.
struct ParticipantLateness {
    histogram: Histogram,
    overruns: u64,
    too_long: u64,
    largest_at: Ticks,
    /// Work on the step that is not yet complete, ns.
    work_ns: u64,
}

impl LatenessMonitor {
    pub(crate) fn new(participants: usize, requested: f64, overrun: Overrun) -> LatenessMonitor {
        let empty = |_| ParticipantLateness {
            histogram: Histogram::default(),
            overruns: 0,
            too_long: 0,
            largest_at: 0,
            work_ns: 0,
        };
        LatenessMonitor {
            requested,
            overrun,
            participants: (0..participants).map(empty).collect(),
            first: None,
            newest: (0, 0.0, 0.0),
            before: (0.0, 0.0),
        }
    }

    /// Evaluates a span of participant number `number`. The clock has looked for suspensions since the end of the span.
    pub(crate) fn evaluate(&mut self, number: usize, span: &Span, clock: &ClockController, plan: &Plan) {
        let SpanActivity::Computing { done } = span.activity else {
            return;
        };
        let participant = &plan.participants[number];
        if span.activation >= participant.activations {
            return;
        }
        let Some(pace) = clock.pace() else { return };
        // A suspension is neither work nor lateness.
        let (begin_ns, end_ns) = (pace.active_ns(span.begin_ns), pace.active_ns(span.end_ns));
        let entry = &mut self.participants[number];
        entry.work_ns = (entry.work_ns).saturating_add(end_ns.saturating_sub(begin_ns));
        if !done {
            return;
        }
        let work_ns = std::mem::take(&mut entry.work_ns);
        let at = participant.sample_time.instant(span.activation);
        let (due, next) = (pace.due(at), pace.due(at + participant.sample_time.period));
        let late_ns = end_ns.saturating_sub(due.ns);
        if late_ns > entry.histogram.largest || entry.histogram.count == 0 {
            entry.largest_at = at;
        }
        entry.histogram.add(late_ns);
        let period_s = participant.period.seconds() / self.requested;
        entry.too_long += u64::from(work_ns as f64 > period_s * 1e9);
        let late_s = late_ns as f64 * 1e-9;
        if due.stretch > self.newest.0 {
            let (_, into_s, late_s) = self.newest;
            self.before = (self.before.0 + into_s, self.before.1 + late_s);
            self.newest = (due.stretch, due.into_s, late_s);
        }
        if due.stretch == self.newest.0 && due.into_s >= self.newest.1 {
            let latest = if due.into_s > self.newest.1 { 0.0 } else { self.newest.2 };
            self.newest = (due.stretch, due.into_s, late_s.max(latest));
        }
        if end_ns > next.ns {
            entry.overruns += 1;
            let t = plan.timebase.seconds(at);
            self.first.get_or_insert_with(|| {
                format!(
                    "overrun at t = {t} s: step {} of `{}` was complete {:.3} ms after the wall clock had come to it, and has {:.3} ms until \
                     the next one is due (its own work took {:.3} ms); a run without --overrun stop counts such steps and goes on",
                    span.activation,
                    participant.name,
                    late_s * 1e3,
                    period_s * 1e3,
                    work_ns as f64 * 1e-6
                )
            });
        }
    }

    /// Why the run is to end here, if it is.
    pub(crate) fn stop_reason(&self) -> Option<&str> {
        self.first.as_deref().filter(|_| self.overrun == Overrun::Stop)
    }

    /// The figures so far.
    pub(crate) fn pace_report(&self, plan: &Plan) -> PaceReport {
        let (_, into_s, late_s) = self.newest;
        let (due_s, late_s) = (self.before.0 + into_s, self.before.1 + late_s);
        let achieved = (due_s > 0.0).then(|| self.requested * due_s / (due_s + late_s));
        let all = self
            .participants
            .iter()
            .zip(&plan.participants)
            .map(|(entry, participant)| {
                let seconds = |ns: u64| ns as f64 * 1e-9;
                let quantile = |part: f64| seconds(entry.histogram.quantile(part));
                let lateness = Lateness {
                    steps: entry.histogram.count,
                    overruns: entry.overruns,
                    too_long: entry.too_long,
                    lateness_p50_s: quantile(0.5),
                    lateness_p99_s: quantile(0.99),
                    lateness_p999_s: quantile(0.999),
                    lateness_largest_s: seconds(entry.histogram.largest),
                    largest_at_s: plan.timebase.seconds(entry.largest_at),
                };
                (participant.name.clone(), lateness)
            });
        PaceReport {
            requested: self.requested,
            achieved,
            met: PaceReport::is_met(self.requested, achieved),
            participants: all.collect(),
        }
    }
}

/// Buckets per factor of two: a quantile is at most a thirty-second too large.
const BUCKETS_PER_OCTAVE: u64 = 32;

/// A histogram of times, ns; its size does not depend on their number.
#[derive(Default)]
struct Histogram {
    buckets: Vec<u64>,
    count: u64,
    largest: u64,
}

impl Histogram {
    fn bucket(ns: u64) -> usize {
        let shift = (ns / BUCKETS_PER_OCTAVE).checked_ilog2().unwrap_or(0) + u32::from(ns >= BUCKETS_PER_OCTAVE);
        match shift {
            0 => ns as usize,
            shift => (u64::from(shift) * BUCKETS_PER_OCTAVE + (ns >> (shift - 1)) - BUCKETS_PER_OCTAVE) as usize,
        }
    }

    /// The largest time of a bucket, ns.
    fn bucket_max(bucket: usize) -> u64 {
        let (octave, part) = (bucket as u64 / BUCKETS_PER_OCTAVE, bucket as u64 % BUCKETS_PER_OCTAVE);
        match octave {
            0 => part,
            octave => ((BUCKETS_PER_OCTAVE + part + 1) << (octave - 1)) - 1,
        }
    }

    fn add(&mut self, ns: u64) {
        // About a century; the value comes from another process and may be anything.
        let ns = ns.min(1 << 62);
        let bucket = Self::bucket(ns);
        if self.buckets.len() <= bucket {
            self.buckets.resize(bucket + 1, 0);
        }
        self.buckets[bucket] += 1;
        self.count += 1;
        self.largest = self.largest.max(ns);
    }

    /// The least time, up to the width of a bucket, that the fraction `part` of all times does not exceed; 0 if there are none.
    fn quantile(&self, part: f64) -> u64 {
        let wanted = (part * self.count as f64).ceil() as u64;
        let mut sum = 0;
        for (bucket, count) in self.buckets.iter().enumerate() {
            sum += count;
            if sum >= wanted.max(1) {
                return Self::bucket_max(bucket).min(self.largest);
            }
        }
        0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::participant::{Interface, Kind};
    use lockstep::plan::ParticipantSpec;
    use lockstep::time::Rational;

    const MS: u64 = 1_000_000;

    /// A plan of one participant with a period of 10 ms.
    fn plan() -> Plan {
        let spec = ParticipantSpec {
            name: "a".into(),
            period: Rational::from_millis(10),
            offset: Rational::ZERO,
            interface: Interface::new(Kind::Sampled),
        };
        Plan::build(vec![spec], &[], Rational::from_millis(100_000), 1).expect("a plan")
    }

    /// A step, with its beginning and end in ms.
    fn step(activation: u64, begin: u64, end: u64) -> Span {
        Span {
            activation,
            activity: SpanActivity::Computing { done: true },
            core: 0,
            sleeps: 0,
            begin_ns: begin * MS,
            end_ns: end * MS,
        }
    }

    #[test]
    fn lateness_monitor_counts_no_overrun_for_suspension() {
        let plan = plan();
        for suspension in [200, 996, 5000, 3_600_000] {
            let mut clock = ClockController::of_pace(&plan, 100.0);
            let mut monitor = LatenessMonitor::new(1, 1.0, Overrun::Stop);
            clock.read_clock_at(100 * MS);
            monitor.evaluate(0, &step(9, 90, 91), &clock, &plan);
            // The step at 100 ms was granted before the suspension, and is complete after it; the next ones come after it.
            clock.read_clock_at((104 + suspension) * MS);
            monitor.evaluate(0, &step(10, 100, 104 + suspension), &clock, &plan);
            for activation in 11..=60 {
                let at = 10 * activation + suspension;
                clock.read_clock_at((at + 4) * MS);
                monitor.evaluate(0, &step(activation, at + 3, at + 4), &clock, &plan);
            }
            assert_eq!(monitor.stop_reason(), None);
            let pace = monitor.pace_report(&plan);
            let lateness = &pace.participants["a"];
            assert_eq!((lateness.overruns, lateness.too_long, lateness.steps), (0, 0, 52));
            assert!(lateness.lateness_largest_s <= 5e-3 && pace.met, "{pace:?}");
        }
    }

    #[test]
    fn lateness_monitor_counts_overrun_for_long_step() {
        let plan = plan();
        let mut clock = ClockController::of_pace(&plan, 100.0);
        let mut monitor = LatenessMonitor::new(1, 1.0, Overrun::Stop);
        // Another thread reads the clock meanwhile.
        (1..=50).for_each(|look| clock.read_clock_at(10 * look * MS));
        monitor.evaluate(0, &step(10, 100, 500), &clock, &plan);
        assert!(
            monitor
                .stop_reason()
                .is_some_and(|reason| reason.contains("400.000 ms after"))
        );
        assert_eq!(monitor.pace_report(&plan).participants["a"].too_long, 1);
    }

    #[test]
    fn histogram_quantiles_match_sorted_times_to_a_thirty_second() {
        let draws = lockstep::random::Stream::new(5, "times");
        let mut times: Vec<u64> = (0..5000)
            .map(|at| draws.bits(2 * at) >> (draws.bits(2 * at + 1) % 60 + 4))
            .collect();
        let mut histogram = Histogram::default();
        times.iter().for_each(|&ns| histogram.add(ns));
        times.sort_unstable();
        for part in [0.001, 0.5, 0.99, 0.999, 1.0] {
            let exact = times[(part * times.len() as f64).ceil() as usize - 1];
            let estimate = histogram.quantile(part);
            assert!(
                exact <= estimate && estimate <= exact + exact / BUCKETS_PER_OCTAVE,
                "{part}: {estimate} for {exact}"
            );
        }
        assert_eq!(histogram.quantile(1.0), *times.last().unwrap());
    }

    #[test]
    fn histogram_buckets_are_contiguous() {
        for bucket in 0..1500 {
            let end = Histogram::bucket_max(bucket);
            assert_eq!(
                (Histogram::bucket(end), Histogram::bucket(end + 1)),
                (bucket, bucket + 1)
            );
        }
    }
}
