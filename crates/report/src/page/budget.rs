//! Limits on the number of points of curves, which bound the size of the page whatever the length of the run.

/// The maximum number of points of a curve. A curve with more samples than `samples` is thinned out: the least and the
/// greatest sample of every bucket of neighbours are kept, so that no peak is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Budget {
    pub(crate) samples: u64,
    pub(crate) buckets: u64,
}

impl Budget {
    /// For figures that the scenario or a view chose, or of a tape with few figures.
    pub(crate) const FULL: Budget = Budget {
        samples: 8192,
        buckets: 2048,
    };

    /// For differences between runs.
    pub(crate) const HALF: Budget = Budget {
        samples: 4096,
        buckets: 1024,
    };

    /// For each of `curves` curves of the automatic figures: the page of a tape with many of them has a bounded size. Where
    /// figures were `chosen`, the others have less.
    pub(crate) fn for_curves(curves: usize, chosen: bool) -> Budget {
        let all = if chosen { BUDGET / 4 } else { BUDGET };
        let buckets = (all / curves.max(1) as u64).clamp(256, Budget::FULL.buckets);
        Budget {
            samples: 4 * buckets,
            buckets,
        }
    }
}

/// The total number of buckets of all curves of automatic figures; each takes 32 bytes of the page.
const BUDGET: u64 = 1 << 18;
