//! How large a curve may become, so that the page has a bounded size whatever the length of the run.

/// How many points a curve may have. One with more samples than `samples` is thinned out: of every bucket of neighbours the
/// least and the greatest sample stay, so that no peak is lost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Budget {
    pub(crate) samples: u64,
    pub(crate) buckets: u64,
}

impl Budget {
    /// For figures that somebody chose, or of a tape with few of them.
    pub(crate) const FULL: Budget = Budget {
        samples: 8192,
        buckets: 2048,
    };

    /// For what runs differ by.
    pub(crate) const HALF: Budget = Budget {
        samples: 4096,
        buckets: 1024,
    };

    /// For each of `curves` curves that nobody chose: a tape with many of them gets a page of bounded size. Where figures were
    /// `chosen`, the others have less.
    pub(crate) fn among(curves: usize, chosen: bool) -> Budget {
        let all = if chosen { BUDGET / 4 } else { BUDGET };
        let buckets = (all / curves.max(1) as u64).clamp(256, Budget::FULL.buckets);
        Budget {
            samples: 4 * buckets,
            buckets,
        }
    }
}

/// All curves that nobody chose have so many buckets together; each takes 32 bytes of the page.
const BUDGET: u64 = 1 << 18;
