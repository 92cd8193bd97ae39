//! Pairing of two streams at different rates: the sample of the second that is valid at each sample of the first.

use std::collections::VecDeque;

use lockstep::time::{SampleTime, Ticks};
use serde::{Deserialize, Serialize};

use super::window::Window;

/// Pairs the samples of two streams, in any order of arrival: each sample of the first is paired with the newest sample of
/// the second stamped at or before it, the one that an input without delay would read. Samples that arrive early are
/// buffered: of the first, as many as its participant runs ahead of the other; of the second, the newest one and those that
/// are paired with samples of the first.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Pairing {
    first: SampleTime,
    second: SampleTime,
    /// The window of samples of the first that count.
    window: Window,
    /// The number of samples of the second so far.
    received: u64,
    /// Samples of the first whose partner has not arrived: stamp, s, index of the partner; and the values of all,
    /// concatenated.
    waiting: VecDeque<(f64, u64)>,
    waiting_values: VecDeque<f64>,
    /// Samples of the second by index, and their values.
    buffered: VecDeque<u64>,
    buffered_values: VecDeque<f64>,
    width: usize,
}

impl Pairing {
    /// Creates the pairing for samples with `width` values each; of the first stream those in `window` count.
    pub(super) fn new(first: SampleTime, second: SampleTime, window: Window, width: usize) -> Pairing {
        Pairing {
            first,
            second,
            window,
            received: 0,
            waiting: VecDeque::new(),
            waiting_values: VecDeque::new(),
            buffered: VecDeque::new(),
            buffered_values: VecDeque::new(),
            width,
        }
    }

    /// Adds sample number `index` of the first, which lies in the window. A sample before the first one of the second has
    /// no partner, and is left out.
    pub(super) fn push_first(&mut self, index: u64, stamp_s: f64, values: impl FnOnce(&mut VecDeque<f64>)) {
        if let Some(partner) = self.second.index_at_or_before(self.first.instant(index)) {
            self.waiting.push_back((stamp_s, partner));
            values(&mut self.waiting_values);
        }
    }

    /// Adds the next sample of the second.
    pub(super) fn push_second(&mut self, values: impl FnOnce(&mut VecDeque<f64>)) {
        if let Some(newest) = self.buffered.back().copied()
            && newest + 1 == self.received
            && self
                .reading_instant(newest)
                .is_none_or(|reader| reader >= self.second.instant(self.received))
        {
            self.buffered.pop_back();
            self.buffered_values.truncate(self.buffered_values.len() - self.width);
        }
        let index = self.received;
        self.received += 1;
        if self.reading_instant(index).is_some() {
            self.buffered.push_back(index);
            values(&mut self.buffered_values);
        }
    }

    /// The next instant of the first, within the window, at or after sample number `index` of the second.
    fn reading_instant(&self, index: u64) -> Option<Ticks> {
        let reader = self.window.from(self.first.count_before(self.second.instant(index)));
        self.window.contains(reader).then(|| self.first.instant(reader))
    }

    /// Writes the next pair to `first` and `second`, if there is one; returns the stamp of the first, s.
    pub(super) fn next(&mut self, first: &mut Vec<f64>, second: &mut Vec<f64>) -> Option<f64> {
        let &(stamp_s, partner) = self.waiting.front()?;
        // The newest sample may be the partner at the end.
        let received = self.received;
        let over = |index: &u64| *index < partner && *index + 1 < received;
        while self.buffered.front().is_some_and(over) {
            self.buffered.pop_front();
            self.buffered_values.drain(..self.width);
        }
        if self.buffered.front() != Some(&partner) {
            return None;
        }
        self.waiting.pop_front();
        first.clear();
        first.extend(self.waiting_values.drain(..self.width));
        second.clear();
        second.extend(self.buffered_values.iter().take(self.width));
        Some(stamp_s)
    }

    /// The pair that is left at the end of both streams, where sample number `index` of the first is the newest: the stamp, s,
    /// and the values of both. The last sample of a continuous participant is stamped at or after the end of the run. By then
    /// the second may have ended, and its newest sample is the partner. No other instant of a complete run waits at its end.
    /// Where a run was cut short, instants stay without a partner, except the newest one if the second has come beyond the
    /// instant before it.
    pub(super) fn final_pair(&self, index: u64) -> Option<(f64, Vec<f64>, Vec<f64>)> {
        let before = self.first.instant(index.checked_sub(1)?);
        let ended =
            self.waiting.len() == 1 && self.window.contains(index) && before < self.second.instant(self.received);
        if !ended || self.buffered.back()? + 1 != self.received {
            return None;
        }
        let &(stamp_s, _) = self.waiting.front()?;
        let newest = self.buffered_values.len() - self.width;
        Some((
            stamp_s,
            self.waiting_values.iter().copied().collect(),
            self.buffered_values.range(newest..).copied().collect(),
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::super::window::{sample_time, timebase};
    use super::*;
    use lockstep::time::Rational;

    /// The pairs of streams whose samples are their stamps in ms, with these periods in ms and these numbers of samples.
    fn pairs(periods: [i64; 2], counts: [u64; 2], second_leads: bool) -> Vec<(f64, f64)> {
        let base = timebase([Rational::from_millis(1)]).unwrap();
        let [first, second] =
            periods.map(|period| sample_time(&base, Rational::ZERO, Rational::from_millis(period)).unwrap());
        let window = Window::between(&base, first, None, None).unwrap();
        let mut pairing = Pairing::new(first, second, window, 1);
        let (mut found, mut of, mut minus) = (Vec::new(), Vec::new(), Vec::new());
        for of_second in [second_leads, !second_leads] {
            for index in 0..counts[usize::from(of_second)] {
                if of_second {
                    pairing.push_second(|values| values.push_back(second.instant(index) as f64));
                } else {
                    let stamp = first.instant(index) as f64;
                    pairing.push_first(index, stamp / 1e3, |values| values.push_back(stamp));
                }
                while pairing.next(&mut of, &mut minus).is_some() {
                    found.push((of[0], minus[0]));
                }
            }
        }
        let last = pairing.final_pair(counts[0] - 1);
        found.extend(last.map(|(_, of, minus)| (of[0], minus[0])));
        found
    }

    #[test]
    fn pairing_of_complete_run_has_newest_sample_of_second() {
        // Over 1 s the sampled streams of 7 ms and 1 ms have 143 and 1000 samples, the continuous ones have one more.
        let cases: [([i64; 2], [u64; 2]); 5] = [
            ([7, 1], [144, 1000]),
            ([7, 1], [144, 1001]),
            ([7, 1], [143, 1000]),
            ([1, 7], [1001, 143]),
            ([1, 7], [1001, 144]),
        ];
        for (periods, counts) in cases {
            let expected: Vec<(f64, f64)> = (0..counts[0] as i64)
                .map(|k| {
                    let stamp = k * periods[0];
                    let partner = (stamp / periods[1]).min(counts[1] as i64 - 1);
                    (stamp as f64, (partner * periods[1]) as f64)
                })
                .collect();
            for second_leads in [false, true] {
                assert_eq!(pairs(periods, counts, second_leads), expected, "{periods:?} {counts:?}");
            }
        }
    }

    #[test]
    fn pairing_beyond_end_of_short_stream_has_no_partner() {
        for second_leads in [false, true] {
            let found = pairs([7, 1], [144, 900], second_leads);
            assert_eq!(found.last(), Some(&(896.0, 896.0)));
        }
    }
}
