//! Parts of a view: figures, their curves and limits.

use std::sync::Arc;

use lockstep::time::Rational;
use tape::StreamSpec;

use super::signal::Signal;
use crate::scene::Scene;

/// A list of figures and of marked instants.
#[derive(Clone, Default)]
pub struct View {
    /// The figures in the order of the page.
    pub figures: Vec<Figure>,
    /// Named instants, s: marked in every figure.
    pub marks: Vec<(String, Rational)>,
    /// The keys of `summary.json` that are shown first; one whose value is true or false is the verdict.
    pub headline: Vec<String>,
    /// The scene of the playback, where the scenario has none.
    pub scene: Option<Scene>,
    /// Errors, as notes on the page.
    pub notes: Vec<String>,
}

/// Creates the view of an application from the streams of a run and its plan; empty for a run of another kind.
pub type Views = Arc<dyn Fn(&[StreamSpec], &toml::Table) -> View + Send + Sync>;

/// A figure.
#[derive(Clone)]
pub struct Figure {
    /// Identifier, short and stable: used in file names and anchors.
    pub id: String,
    /// The heading of the figure's section on the page.
    pub group: String,
    /// Its title.
    pub title: String,
    /// The unit drawn.
    pub unit: Unit,
    /// The curves. A curve whose fields no stream has is left out, and a figure without curves too.
    pub curves: Vec<Curve>,
    /// The quantity of the horizontal axis, where that is not time.
    pub against: Option<Curve>,
    /// Horizontal lines.
    pub limits: Vec<Line>,
}

/// The unit in which a figure is drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum Unit {
    /// The unit of the first curve's fields, with a prefix that fits the values.
    Own,
    /// This unit: it must have the same dimension as that of the fields.
    Named(String),
    /// This unit, and the factor from the unit of the fields.
    Scaled(String, f64),
}

/// A horizontal line in a figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Its position: a value in the unit of the first curve's fields, or a quantity as written in a scenario.
    pub at: toml::Value,
    /// Its label.
    pub text: String,
}

/// Curves computed from signals.
#[derive(Clone)]
pub struct Curve {
    /// The computation and its signals.
    pub formula: Formula,
    /// One label for each curve; by default `x y z` for three, and numbers for more.
    pub labels: Vec<String>,
}

/// A formula of signals. Its first signal leads: the samples of that signal are the instants of the curve, and the other
/// signals are resampled there by the delivery rule: the newest sample stamped at or before.
#[derive(Clone)]
pub enum Formula {
    /// Every element.
    Each(Signal),
    /// The element-wise difference of two signals.
    Difference(Signal, Signal),
    /// The Euclidean length.
    Norm(Signal),
    /// The length of the difference of two vectors.
    Distance(Signal, Signal),
    /// The angle between two attitudes (quaternions, scalar first), rad.
    Angle(Signal, Signal),
    /// A position relative to an origin, both in world axes, transformed to the axes of an attitude.
    PositionIn(Signal, Signal, Signal),
    /// The vector part of the relative quaternion from one attitude to another, for the shorter rotation.
    AttitudeIn(Signal, Signal),
    /// The rotation vector of an attitude, rad.
    RotationVector(Signal),
    /// A user-defined function of the records of the first stream with that port.
    Computed(Arc<dyn Computed>),
}

/// Curves that a program computes from the payload of one stream. Long streams are evaluated at evenly spaced instants
/// only.
pub trait Computed: Send + Sync {
    /// The stream: participant and port.
    fn stream(&self) -> (&str, &str);
    /// The curves' labels.
    fn labels(&self) -> Vec<String>;
    /// Their origin, in words.
    fn origin(&self) -> String;
    /// The values of all curves in one record, in the order of the labels.
    fn values(&self, payload: &[u8], out: &mut [f64]);
}

impl Figure {
    /// A figure without curves in `unit`; `scale` is the factor from the unit of its fields.
    pub fn new(group: &str, id: &str, title: &str, unit: (&str, f64)) -> Figure {
        Figure {
            id: id.to_owned(),
            group: group.to_owned(),
            title: title.to_owned(),
            unit: Unit::Scaled(unit.0.to_owned(), unit.1),
            curves: Vec::new(),
            against: None,
            limits: Vec::new(),
        }
    }

    /// Adds curves, with their labels.
    #[must_use]
    pub fn curve(mut self, formula: Formula, labels: &[&str]) -> Figure {
        let labels = labels.iter().map(|label| (*label).to_owned()).collect();
        self.curves.push(Curve { formula, labels });
        self
    }

    /// Adds lines above and below zero at these values in the unit of the fields.
    #[must_use]
    pub fn between(mut self, values: &[f64]) -> Figure {
        for value in values.iter().map(|value| value.abs()) {
            for line in [value, -value] {
                let at = toml::Value::Float(line);
                if !self.limits.iter().any(|there| there.at == at) {
                    let text = "limit".to_owned();
                    self.limits.push(Line { at, text });
                }
            }
        }
        self
    }
}
