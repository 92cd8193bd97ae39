//! What a view consists of: figures, their curves and limits.

use std::sync::Arc;

use lockstep::time::Rational;
use tape::StreamSpec;

use super::signal::Signal;
use crate::scene::Scene;

/// A list of figures and of instants to be marked.
#[derive(Clone, Default)]
pub struct View {
    /// The figures in the order of the page.
    pub figures: Vec<Figure>,
    /// Named instants, s: marks in every figure.
    pub marks: Vec<(String, Rational)>,
    /// The keys of `summary.json` that stand at the top; one that is true or false is the verdict.
    pub headline: Vec<String>,
    /// What the playback shows, where the scenario has no scene of its own.
    pub scene: Option<Scene>,
    /// What could not be made, in words that stand on the page.
    pub notes: Vec<String>,
}

/// Makes the view of an application from the streams of a run and its plan; empty for a run of another kind.
pub type Views = Arc<dyn Fn(&[StreamSpec], &toml::Table) -> View + Send + Sync>;

/// A figure.
#[derive(Clone)]
pub struct Figure {
    /// Short and stable: names files and anchors.
    pub id: String,
    /// The heading under which the figure stands.
    pub group: String,
    /// What it shows, in words.
    pub title: String,
    /// The unit drawn.
    pub unit: Unit,
    /// The curves. One whose fields nobody publishes is left out, and a figure without curves too.
    pub curves: Vec<Curve>,
    /// What runs along the horizontal axis in place of time.
    pub against: Option<Curve>,
    /// Horizontal lines.
    pub limits: Vec<Line>,
}

/// The unit in which a figure is drawn.
#[derive(Debug, Clone, PartialEq)]
pub enum Unit {
    /// That of the first curve's fields, with a prefix that fits the values.
    Own,
    /// This one: the fields' unit must have the same dimension.
    Named(String),
    /// This one, and how many of them one unit of the fields is.
    Scaled(String, f64),
}

/// A horizontal line in a figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    /// Where it lies: a value in the unit of the first curve's fields, or a quantity as a scenario writes it.
    pub at: toml::Value,
    /// What it is, in words.
    pub text: String,
}

/// Curves that follow from signals.
#[derive(Clone)]
pub struct Curve {
    /// What is computed of which signals.
    pub formula: Formula,
    /// One label for each curve; where they are missing, `x y z` of three, and numbers of more.
    pub labels: Vec<String>,
}

/// What is drawn of signals. The first signal of a formula leads: its samples are the instants of the curve, and the other
/// signals are read there by the delivery rule: the newest sample stamped at or before.
#[derive(Clone)]
pub enum Formula {
    /// Every element.
    Each(Signal),
    /// Every element of one less the same of the other.
    Difference(Signal, Signal),
    /// The Euclidean length.
    Norm(Signal),
    /// The length of the difference of two vectors.
    Distance(Signal, Signal),
    /// The angle between two attitudes (quaternions, scalar first), rad.
    Angle(Signal, Signal),
    /// A position from an origin, both in world axes, in the axes of an attitude.
    PositionIn(Signal, Signal, Signal),
    /// The vector part of the quaternion of an attitude in the axes of another, of the shorter turn.
    AttitudeIn(Signal, Signal),
    /// The rotation vector of an attitude, rad.
    RotationVector(Signal),
    /// Whatever a program computes from the records of the first stream with that port.
    Computed(Arc<dyn Computed>),
}

/// Curves that a program computes from the payload of one stream. Long streams are asked for at evenly spaced instants only.
pub trait Computed: Send + Sync {
    /// The stream: participant and port.
    fn stream(&self) -> (&str, &str);
    /// The curves' labels.
    fn labels(&self) -> Vec<String>;
    /// Where they come from, in words.
    fn origin(&self) -> String;
    /// The values of all curves in one record, in the order of the labels.
    fn values(&self, payload: &[u8], out: &mut [f64]);
}

impl Figure {
    /// A figure without curves in `unit`, which is `scale` times the unit of its fields.
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

    /// With curves, and their labels.
    #[must_use]
    pub fn curve(mut self, formula: Formula, labels: &[&str]) -> Figure {
        let labels = labels.iter().map(|label| (*label).to_owned()).collect();
        self.curves.push(Curve { formula, labels });
        self
    }

    /// With lines above and below zero at these values in the unit of the fields.
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
