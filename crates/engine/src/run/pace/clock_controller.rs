//! The clock controller: how far the participants may go. It obeys stops, the pace of the wall clock, and external control of the
//! run.

use std::sync::Arc;

use lockstep::plan::Plan;
use lockstep::span::now_ns;
use lockstep::time::Ticks;

use super::wall_clock::Pace;
use crate::live::Steering;
use crate::run::options::Options;
use crate::run::stops::schedule::{Action, Schedule};
use crate::scenario::Scenario;

/// A run under external control is granted about this much wall time in advance, ns, so that it never waits for a grant and still
/// stops soon.
const AHEAD_NS: u64 = 50_000_000;

/// Determines the horizon of one run.
pub(crate) struct ClockController {
    end: Ticks,
    /// The instants at which the run is paused before its end, and the reasons.
    schedule: Schedule,
    pace: Option<Pace>,
    steering: Option<Arc<Steering>>,
    look_ahead: LookAhead,
    granted: Ticks,
    /// Where the run is paused for the program that drives it.
    bound: Option<Ticks>,
}

impl ClockController {
    /// The controller for a run of `plan` that begins at `from`; its wall clock starts now.
    pub(crate) fn new(plan: &Plan, options: &Options, schedule: Schedule, from: Ticks) -> ClockController {
        let tick = plan.timebase.tick();
        let shortest = plan.participants.iter().map(|planned| planned.sample_time.period).min();
        let ticks_per_s = tick.denominator() as f64 / tick.numerator() as f64;
        ClockController {
            end: plan.end,
            schedule,
            pace: options
                .pace
                .map(|factor| Pace::new(factor * ticks_per_s, from, now_ns()).with_watch_thread()),
            steering: options.steering.clone(),
            look_ahead: LookAhead::new(shortest.unwrap_or(1)),
            granted: from,
            bound: None,
        }
    }

    /// The controller for a run of `plan` without stops whose wall clock has started at 0 and lets `ticks_per_s` through.
    #[cfg(test)]
    pub(super) fn of_pace(plan: &Plan, ticks_per_s: f64) -> ClockController {
        ClockController {
            end: plan.end,
            schedule: Schedule::of_pauses(Vec::new()),
            pace: Some(Pace::new(ticks_per_s, 0, 0)),
            steering: None,
            look_ahead: LookAhead::new(1),
            granted: 0,
            bound: None,
        }
    }

    /// Reads the clock when it is `now`, ns.
    #[cfg(test)]
    pub(super) fn read_clock_at(&mut self, now: u64) {
        self.horizon_at(0, now);
    }

    /// Sets the instant at which the run is paused for its driving program; with `None` it pauses only where its schedule has a stop.
    pub(crate) fn set_bound(&mut self, bound: Option<Ticks>) {
        self.bound = bound;
    }

    /// Goes back to `to`; `schedule` has the stops from there on.
    pub(crate) fn reset(&mut self, schedule: Schedule, to: Ticks) {
        (self.schedule, self.granted, self.look_ahead.granted) = (schedule, to, to);
        self.resume();
    }

    /// How far all participants may go now, when the newest sample is stamped `newest`. Never less than before.
    pub(crate) fn horizon(&mut self, newest: Ticks) -> Ticks {
        // Without a pace or control from outside no clock is read: a run in one process then needs none.
        let now = (self.steering.is_some() || self.pace.is_some()).then(now_ns);
        self.horizon_at(newest, now.unwrap_or(0))
    }

    fn horizon_at(&mut self, newest: Ticks, now: u64) -> Ticks {
        let mut limit = self.stop().unwrap_or(self.end);
        let mut horizon = limit;
        if let Some(steering) = &self.steering {
            limit = limit.min(steering.limit().max(self.granted));
            horizon = limit.min(self.look_ahead.horizon(newest, now));
        }
        if let Some(pace) = &mut self.pace {
            // The participants may do everything before the instant that has come, and the activations at that instant too.
            horizon = limit.min(pace.reached(limit, now).saturating_add(1));
        }
        self.granted = self.granted.max(horizon);
        self.granted
    }

    /// Reports to the external control how far the run is, and whether all participants are paused at the horizon.
    pub(crate) fn report_progress(&self, newest: Ticks, resting: bool) {
        if let Some(steering) = &self.steering {
            steering.tell(newest, self.granted, resting);
        }
    }

    /// The pace of the wall clock, if the run keeps pace with it.
    pub(crate) fn pace(&self) -> Option<&Pace> {
        self.pace.as_ref()
    }

    /// The next stop.
    pub(crate) fn stop(&self) -> Option<Ticks> {
        self.schedule.next().into_iter().chain(self.bound).min()
    }

    /// Whether the schedule has nothing to do at `now`.
    pub(crate) fn is_idle_at(&self, now: Ticks) -> bool {
        self.schedule.next() != Some(now)
    }

    /// Takes the next scheduled action of the stop at `now`.
    pub(crate) fn take(&mut self, now: Ticks) -> Option<Action> {
        self.schedule.take(now)
    }

    /// Puts back an action that was taken and could not be done.
    pub(crate) fn put_back(&mut self, now: Ticks, action: Action) {
        self.schedule.put_back(now, action);
    }

    /// The run goes back: the substitutions from number `done` on are still to come.
    pub(crate) fn rewind(&mut self, scenario: &Scenario, plan: &Plan, done: usize) {
        self.schedule.rewind(scenario, plan, done);
        // Substitutes are started where all participants are paused, and the newest stop may be before the granted time.
        self.granted = self.granted.min(self.schedule.next().unwrap_or(self.granted));
    }

    /// Rests at `now` for the user, until the returned control lets the run continue.
    pub(crate) fn begin_pause(&self, now: Ticks) -> Option<Arc<Steering>> {
        if let Some(steering) = &self.steering {
            steering.tell(now, now, true);
            steering.pause();
        }
        self.steering.clone()
    }

    /// Continues after a stop: the wall time spent in the stop does not count.
    pub(crate) fn resume(&mut self) {
        if let Some(pace) = &mut self.pace {
            pace.restart_at(self.granted, now_ns());
        }
    }
}

/// How far beyond the newest sample a run under external control and without a pace is granted time, so that a request to pause
/// still takes effect soon.
struct LookAhead {
    min_ticks: Ticks,
    ticks: Ticks,
    granted: Ticks,
    since: Option<u64>,
}

impl LookAhead {
    fn new(shortest: Ticks) -> LookAhead {
        let min_ticks = shortest.saturating_mul(16);
        LookAhead {
            min_ticks,
            ticks: min_ticks,
            granted: 0,
            since: None,
        }
    }

    /// Grants more when half of the last grant is used up: twice as much when that was quick, half as much when it was slow.
    fn horizon(&mut self, newest: Ticks, now: u64) -> Ticks {
        if newest.saturating_add(self.ticks / 2) < self.granted {
            return self.granted;
        }
        if let Some(since) = self.since {
            let took = now.saturating_sub(since);
            if took < AHEAD_NS / 2 {
                self.ticks = self.ticks.saturating_mul(2);
            } else if took > AHEAD_NS * 2 {
                self.ticks = (self.ticks / 2).max(self.min_ticks);
            }
        }
        self.since = Some(now);
        self.granted = newest.max(0).saturating_add(self.ticks);
        self.granted
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn clock(stops: Vec<Ticks>, pace: Option<f64>, steering: Option<Arc<Steering>>, start: u64) -> ClockController {
        let pace = pace.map(|ticks_per_s| Pace::new(ticks_per_s, 0, start));
        ClockController {
            end: 100_000,
            schedule: Schedule::of_pauses(stops),
            pace,
            steering,
            look_ahead: LookAhead::new(1),
            granted: 0,
            bound: None,
        }
    }

    /// The last answer of looks every 100 ms, from `from` to `to`.
    fn horizon_after_reads(clock: &mut ClockController, newest: Ticks, start: u64, from: u64, to: u64) -> Ticks {
        let looks = (from..to).step_by(100).chain([to]);
        looks
            .map(|at| clock.horizon_at(newest, start + ms(at)))
            .last()
            .unwrap_or(0)
    }

    #[test]
    fn paced_run_does_not_catch_up_after_suspension() {
        let start = 0;
        let mut clock = clock(vec![], Some(1000.0), None, start);
        assert_eq!(clock.horizon_at(0, start + ms(100)), 101);
        assert_eq!(clock.horizon_at(101, start + ms(3_600_100)), 101);
        assert_eq!(clock.horizon_at(101, start + ms(3_600_150)), 151);
    }

    fn ms(count: u64) -> u64 {
        count * 1_000_000
    }

    #[test]
    fn unpaced_run_is_granted_time_to_its_end_at_once() {
        let now = 0;
        assert_eq!(clock(vec![], None, None, now).horizon_at(0, now), 100_000);
        assert_eq!(clock(vec![70], None, None, now).horizon_at(0, now), 70);
    }

    #[test]
    fn paced_run_does_not_catch_up_after_pause() {
        let start = 0;
        let mut clock = clock(vec![500], Some(1000.0), None, start);
        assert_eq!(clock.horizon_at(0, start + ms(100)), 101);
        // The stop is reached after 500 ms of wall time; ten seconds later the user lets the run continue.
        assert_eq!(horizon_after_reads(&mut clock, 500, start, 200, 600), 500);
        assert_eq!(horizon_after_reads(&mut clock, 500, start, 700, 10_600), 500);
        clock.take(500);
        assert_eq!(clock.horizon_at(500, start + ms(10_700)), 601);
    }

    #[test]
    fn live_control_pauses_and_resumes_paced_run() {
        let start = 0;
        let steering = Arc::new(Steering::default());
        let mut clock = clock(vec![], Some(1000.0), Some(steering.clone()), start);
        assert_eq!(clock.horizon_at(0, start + ms(100)), 101);
        steering.pause();
        assert_eq!(horizon_after_reads(&mut clock, 101, start, 200, 5000), 101);
        steering.go_to(131);
        assert_eq!(horizon_after_reads(&mut clock, 101, start, 5001, 9000), 131);
        steering.resume();
        assert_eq!(clock.horizon_at(131, start + ms(9001)), 133);
    }

    #[test]
    fn look_ahead_of_unpaced_run_follows_its_speed() {
        let start = 0;
        let steering = Arc::new(Steering::default());
        let mut clock = clock(vec![], None, Some(steering.clone()), start);
        assert_eq!(clock.horizon_at(0, start), 16);
        assert_eq!(clock.horizon_at(7, start + ms(1)), 16, "more than half is left");
        assert_eq!(clock.horizon_at(8, start + ms(2)), 40, "quick: twice as much");
        assert_eq!(clock.horizon_at(30, start + ms(500)), 46, "slow: half as much");
        steering.pause();
        assert_eq!(clock.horizon_at(46, start + ms(501)), 46);
        steering.resume();
        assert!(clock.horizon_at(46, start + ms(502)) > 46);
    }
}
