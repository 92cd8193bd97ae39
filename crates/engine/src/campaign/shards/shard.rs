//! Shards of a campaign's points, and the points that are run twice.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::campaign::POINTS_MAX;

/// Shard number `number` of `of`: every `of`-th point, starting at point `number`.
///
/// Every `of`-th point, not a contiguous range: the points of a grid cost more towards one of its ends, and a shard keeps
/// its points when a campaign grows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// From 1.
    pub number: usize,
    /// The number of shards.
    pub of: usize,
}

/// The text does not name a shard.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is not a shard: write K/N with K from 1 to N, such as 3/8 (N at most {POINTS_MAX})")]
pub struct ParseShardError {
    /// The text.
    pub text: String,
}

impl FromStr for Shard {
    type Err = ParseShardError;

    fn from_str(text: &str) -> Result<Shard, ParseShardError> {
        let read = || {
            let (number, of) = text.split_once('/')?;
            let (number, of) = (number.trim().parse().ok()?, of.trim().parse().ok()?);
            ((1..=of).contains(&number) && of <= POINTS_MAX).then_some(Shard { number, of })
        };
        read().ok_or_else(|| ParseShardError { text: text.to_owned() })
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.number, self.of)
    }
}

impl Shard {
    /// Whether point `at` (from 0) belongs to the shard.
    pub fn owns(&self, at: usize) -> bool {
        at % self.of == self.number - 1
    }

    /// Whether the shard runs point `at` (from 0) of the preceding shard a second time, when `share` of all points are run
    /// twice.
    pub fn audits(&self, at: usize, share: f64) -> bool {
        let before = (self.number + self.of - 2) % self.of;
        self.of > 1 && at % self.of == before && audited(at / self.of, share)
    }
}

/// Whether point number `rank` (from 0) of a shard is run twice: the first of each shard, and evenly spread others up to
/// the share `share`. So every node is checked, and no point changes its role when a campaign grows.
fn audited(rank: usize, share: f64) -> bool {
    let upto = |rank: usize| (rank as f64 * share).ceil();
    share > 0.0 && upto(rank + 1) > upto(rank)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_point_has_one_shard() {
        for of in [1, 2, 3, 7, 20] {
            let shards: Vec<Shard> = (1..=of).map(|number| Shard { number, of }).collect();
            for at in 0..50 {
                assert_eq!(shards.iter().filter(|shard| shard.owns(at)).count(), 1, "{at} of {of}");
            }
        }
    }

    #[test]
    fn audited_points_are_the_share_in_another_shard() {
        let shards: Vec<Shard> = (1..=4).map(|number| Shard { number, of: 4 }).collect();
        let twice = |points: usize, share: f64| -> Vec<usize> {
            (0..points)
                .filter(|at| {
                    let auditors: Vec<&Shard> = shards.iter().filter(|shard| shard.audits(*at, share)).collect();
                    assert!(auditors.len() <= 1);
                    assert!(
                        auditors.iter().all(|shard| !shard.owns(*at)),
                        "point {at} has two shards"
                    );
                    !auditors.is_empty()
                })
                .collect()
        };
        assert_eq!(twice(4000, 0.01).len(), 40);
        assert_eq!(
            twice(8, 0.01),
            [0, 1, 2, 3],
            "one of each shard however small the share"
        );
        assert_eq!(twice(100, 1.0).len(), 100);
        assert_eq!(twice(100, 0.0).len(), 0);
        // A campaign that grows keeps its second runs.
        let few = twice(100, 0.1);
        assert_eq!(twice(1000, 0.1)[..few.len()], few);
        let alone = Shard { number: 1, of: 1 };
        assert!(!alone.audits(0, 1.0), "there is no other shard");
    }

    #[test]
    fn shard_parser_rejects_invalid_text() {
        assert_eq!("3/8".parse(), Ok(Shard { number: 3, of: 8 }));
        for text in ["0/8", "9/8", "3", "3/", "a/b", "1/100001", "-1/2"] {
            let error = text.parse::<Shard>().unwrap_err().to_string();
            assert!(error.contains(text) && error.contains("such as 3/8"), "{error}");
        }
    }
}
