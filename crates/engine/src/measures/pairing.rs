//! Pairing of two streams at different rates: the sample of the second that is valid at each sample of the first.

use std::collections::VecDeque;

use lockstep::time::SampleTime;
use serde::{Deserialize, Serialize};

use super::window::Window;

/// Pairs the samples of two streams, in any order of arrival: each sample of the first is paired with the newest sample of
/// the second stamped at or before it, the one that an input without delay would read. Samples that arrive early are
/// buffered: as many as one participant runs ahead of the other, and no sample of the second that belongs to none of the
/// first.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(super) struct Pairing {
    first: SampleTime,
    second: SampleTime,
    /// The window of samples of the first that count.
    window: Window,
    /// The number of samples of the second so far.
    come: u64,
    /// Samples of the first whose partner has not arrived: stamp, s, index of the partner; and the values of all,
    /// concatenated.
    waiting: VecDeque<(f64, u64)>,
    waiting_values: VecDeque<f64>,
    /// Samples of the second by index, and their values.
    held: VecDeque<u64>,
    held_values: VecDeque<f64>,
    width: usize,
}

impl Pairing {
    /// Creates the pairing for samples with `width` values each; of the first stream those in `window` count.
    pub(super) fn new(first: SampleTime, second: SampleTime, window: Window, width: usize) -> Pairing {
        Pairing {
            first,
            second,
            window,
            come: 0,
            waiting: VecDeque::new(),
            waiting_values: VecDeque::new(),
            held: VecDeque::new(),
            held_values: VecDeque::new(),
            width,
        }
    }

    /// Adds sample number `index` of the first, which lies in the window. A sample before the first one of the second has
    /// no partner, and is left out.
    pub(super) fn first(&mut self, index: u64, stamp_s: f64, values: impl FnOnce(&mut VecDeque<f64>)) {
        if let Some(partner) = self.second.index_at_or_before(self.first.instant(index)) {
            self.waiting.push_back((stamp_s, partner));
            values(&mut self.waiting_values);
        }
    }

    /// Adds the next sample of the second.
    pub(super) fn second(&mut self, values: impl FnOnce(&mut VecDeque<f64>)) {
        let index = self.come;
        self.come += 1;
        // Is there an instant of the first, within the window, before the next sample of the second?
        let (now, next) = (self.second.instant(index), self.second.instant(index + 1));
        let reader = self.window.from(self.first.count_before(now));
        if self.window.contains(reader) && self.first.instant(reader) < next {
            self.held.push_back(index);
            values(&mut self.held_values);
        }
    }

    /// Writes the next pair to `first` and `second`, if there is one; returns the stamp of the first, s.
    pub(super) fn next(&mut self, first: &mut Vec<f64>, second: &mut Vec<f64>) -> Option<f64> {
        let &(stamp_s, partner) = self.waiting.front()?;
        while self.held.front().is_some_and(|index| *index < partner) {
            self.held.pop_front();
            self.held_values.drain(..self.width);
        }
        if self.held.front() != Some(&partner) {
            return None;
        }
        self.waiting.pop_front();
        first.clear();
        first.extend(self.waiting_values.drain(..self.width));
        second.clear();
        second.extend(self.held_values.iter().take(self.width));
        Some(stamp_s)
    }
}
