//! The random samples of one round.

use lockstep::random::Stream;

/// Random samples determined only by a seed and a name.
pub(super) struct Rng {
    stream: Stream,
    index: u64,
}

impl Rng {
    pub(super) fn new(seed: u64, name: &str) -> Rng {
        Rng {
            stream: Stream::new(seed, name),
            index: 0,
        }
    }

    /// A whole number below `count`.
    pub(super) fn below(&mut self, count: u64) -> u64 {
        self.index += 1;
        self.stream.bits(self.index) % count
    }

    /// A whole number from `first` to `last`, both included.
    pub(super) fn between(&mut self, first: u64, last: u64) -> u64 {
        first + self.below(last - first + 1)
    }

    pub(super) fn one_in(&mut self, count: u64) -> bool {
        self.below(count) == 0
    }

    pub(super) fn choose<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.below(of.len() as u64) as usize]
    }
}
