//! Stopping rule of a campaign: it ends as soon as a figure is known accurately enough.

use std::fmt;
use std::str::FromStr;

use sampling::statistics::{NORMAL_95, wilson};
use serde::{Deserialize, Serialize};

use super::folder::table::figure_of;
use super::workers::point::Result as PointResult;
use super::{CampaignError, Number};

/// With fewer points than this the interval of a mean is not trustworthy.
const MEAN_POINTS_MIN: usize = 30;

/// A figure and the half width of its 95 % confidence interval at which a campaign ends.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct Until {
    /// The share of points that are met, or the mean of the figure of merit with this name.
    figure_name: Option<String>,
    /// Percent: absolute for the share, relative for a mean.
    percent: f64,
}

impl fmt::Display for Until {
    /// As it is read.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{} within {} %",
            self.figure_name.as_deref().unwrap_or("met"),
            self.percent
        )
    }
}

impl From<Until> for String {
    fn from(until: Until) -> String {
        until.to_string()
    }
}

impl TryFrom<String> for Until {
    type Error = String;

    fn try_from(text: String) -> Result<Until, String> {
        text.parse()
    }
}

impl FromStr for Until {
    type Err = String;

    /// Reads `met within 1 %` or `FIGURE within 2 %`.
    fn from_str(text: &str) -> Result<Until, String> {
        let wrong = || {
            format!(
                "`{text}` has no width between 0 and 100 %: write `met within 1 %`, or `FIGURE within 2 %` for the mean of a figure of merit"
            )
        };
        let (figure_name, width) = text.rsplit_once(" within ").ok_or_else(wrong)?;
        let (figure_name, width) = (figure_name.trim(), width.trim().strip_suffix('%').ok_or_else(wrong)?);
        let percent: f64 = width.trim().parse().map_err(|_| wrong())?;
        if figure_name.is_empty() || !(percent > 0.0 && percent < 100.0) {
            return Err(wrong());
        }
        Ok(Until {
            figure_name: (figure_name != "met").then(|| figure_name.to_owned()),
            percent,
        })
    }
}

impl Until {
    /// Checks the rule against a campaign of which `has_criteria` states whether its points are met or not met.
    ///
    /// # Errors
    /// When the rule is for the share of met points, and nothing decides whether a point is met.
    pub fn check(&self, has_criteria: bool) -> Result<(), CampaignError> {
        if self.figure_name.is_some() || has_criteria {
            return Ok(());
        }
        let reason = format!(
            "`{self}`: the scenario has no criterion, so no point is met or not met: name a figure of merit, or give a measure a limit"
        );
        Err(CampaignError::Until(reason))
    }

    /// Creates the watch for a campaign with the figures of merit `known`.
    ///
    /// # Errors
    /// When the figure does not exist.
    pub fn watch(&self, known: &[Number]) -> Result<Watch, CampaignError> {
        let figure = match &self.figure_name {
            Some(name) => Some(figure_of(name, known)?),
            None => None,
        };
        Ok(Watch {
            until: self.clone(),
            figure: figure.map(|figure| figure.key),
            width: self.percent / 100.0,
            evaluated: 0,
            enough: false,
            reached: None,
            ran: 0,
            good: 0,
            mean: 0.0,
            squares: 0.0,
        })
    }
}

/// Evaluates the points in their order, whatever the order in which they end: the end of a campaign depends on nothing
/// else.
#[derive(Debug, Clone)]
pub struct Watch {
    until: Until,
    figure: Option<String>,
    width: f64,
    /// The number of points evaluated, counted from the first.
    evaluated: usize,
    enough: bool,
    /// The half width of the interval so far; for a mean in parts of it.
    reached: Option<f64>,
    /// The points that ran (and have the figure), and how many of them are good.
    ran: usize,
    good: usize,
    /// Mean and sum of squared distances from it (Welford's).
    mean: f64,
    squares: f64,
}

impl Watch {
    /// The rule.
    pub fn until(&self) -> &Until {
        &self.until
    }

    /// Evaluates the points that have arrived; returns the number of points, from the first on, with which the campaign
    /// ends, if it does.
    pub(super) fn evaluate(&mut self, results: &[Option<PointResult>]) -> Option<usize> {
        while !self.enough
            && let Some(Some(result)) = results.get(self.evaluated)
        {
            self.evaluated += 1;
            self.add(result);
        }
        self.enough.then_some(self.evaluated)
    }

    /// The half width of the interval after all `results`, percent as in the rule, and whether it is narrow enough.
    pub fn reached(mut self, results: &[Option<PointResult>]) -> (Option<f64>, bool) {
        self.evaluate(results);
        let percent = self.reached.filter(|width| width.is_finite());
        (percent.map(|width| 100.0 * width), self.enough)
    }

    fn add(&mut self, result: &PointResult) {
        if !result.outcome.ran() {
            return;
        }
        let Some(key) = &self.figure else {
            self.ran += 1;
            self.good += usize::from(result.outcome.good());
            let (low, high) = wilson(self.good, self.ran);
            let half = (high - low) / 2.0;
            self.reached = Some(half);
            self.enough = half <= self.width;
            return;
        };
        let Some(value) = result.figures.as_ref().and_then(|figures| figures.value(key)) else {
            return;
        };
        self.ran += 1;
        let (n, before) = (self.ran as f64, value - self.mean);
        self.mean += before / n;
        self.squares += before * (value - self.mean);
        let half = NORMAL_95 * (self.squares / (n - 1.0).max(1.0) / n).sqrt();
        self.reached = (self.ran > 1).then(|| half / self.mean.abs());
        self.enough = self.ran >= MEAN_POINTS_MIN && half <= self.width * self.mean.abs();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::campaign::{Figures, Outcome};

    fn of(met: bool, value: f64) -> PointResult {
        let number = Number {
            key: "miss_mm".into(),
            name: "miss".into(),
            unit: "mm".into(),
            value: Some(value),
        };
        PointResult {
            figures: Some(Figures::new(vec![number], Vec::new())),
            ..PointResult::without(if met { Outcome::Met } else { Outcome::NotMet }, "")
        }
    }

    fn end(until: &str, results: &[Option<PointResult>]) -> Option<usize> {
        let known: Vec<Number> = results[0]
            .as_ref()
            .unwrap()
            .figures
            .as_ref()
            .unwrap()
            .numbers()
            .collect();
        until.parse::<Until>().unwrap().watch(&known).unwrap().evaluate(results)
    }

    #[test]
    fn stopping_rule_of_share_ends_at_narrow_interval() {
        let results: Vec<_> = (0..2000).map(|at| Some(of(at % 2 == 0, 0.0))).collect();
        // The interval of one half has the half width z / (2 sqrt(n + z²)): 0.05 at n = 381, 0.02 at n = 2398.
        assert_eq!(end("met within 5 %", &results), Some(381));
        assert_eq!(end("met within 2 %", &results), None);
        let until: Until = "met within 2 %".parse().unwrap();
        let (percent, enough) = until.watch(&[]).unwrap().reached(&results);
        // z / (2 sqrt(2000 + z²))
        assert!(!enough && (percent.unwrap() - 2.189).abs() < 1e-3, "{percent:?}");
    }

    #[test]
    fn stopping_rule_of_mean_ends_at_narrow_interval() {
        let results: Vec<_> = (0..2000)
            .map(|at| Some(of(true, if at % 2 == 0 { 9.0 } else { 11.0 })))
            .collect();
        // Half width 1.96 / sqrt(n) of the mean 10: 1 % of it at n = 385.
        let at = end("miss within 1 %", &results).unwrap();
        assert!((384..=386).contains(&at), "{at}");
        assert_eq!(end("miss within 90 %", &results), Some(MEAN_POINTS_MIN));
    }

    #[test]
    fn stopping_rule_depends_only_on_order_of_points() {
        let all: Vec<_> = (0..600).map(|at| Some(of(at % 2 == 0, 0.0))).collect();
        let known: Vec<Number> = all[0].as_ref().unwrap().figures.as_ref().unwrap().numbers().collect();
        let mut watch = "met within 5 %".parse::<Until>().unwrap().watch(&known).unwrap();
        let mut some = vec![None; 600];
        // The last first: the points before them are not known yet.
        for at in (100..600).rev() {
            some[at] = all[at].clone();
            assert_eq!(watch.evaluate(&some), None);
        }
        some[..100].clone_from_slice(&all[..100]);
        assert_eq!(watch.evaluate(&some), Some(381));
    }

    #[test]
    fn stopping_rule_round_trips_through_text() {
        for text in ["met within 7 %", "miss distance within 0.1 %"] {
            let until: Until = text.parse().unwrap();
            assert_eq!(until.to_string(), text);
            let json = serde_json::to_string(&until).unwrap();
            assert_eq!(serde_json::from_str::<Until>(&json).unwrap(), until);
        }
    }

    #[test]
    fn stopping_rule_without_width_is_rejected() {
        for text in [
            "met",
            "met within",
            "met within 1",
            "within 1 %",
            "met within 0 %",
            "met within x %",
        ] {
            let error = text.parse::<Until>().unwrap_err();
            assert!(error.contains("`met within 1 %`"), "{error}");
        }
        let until: Until = "beauty within 1 %".parse().unwrap();
        assert!(until.watch(&[]).unwrap_err().to_string().contains("`beauty`"));
        let until: Until = "met within 1 %".parse().unwrap();
        assert!(until.check(false).unwrap_err().to_string().contains("no criterion"));
    }
}
