//! Binding of figures to the streams of a run.

use lockstep::port::{Element, EnumValue};
use lockstep::units;
use serde::Serialize;
use tape::StreamSpec;
use toml::Value;

use super::evaluate::{Evaluate, Operand};
use super::prefix::{Scale, scales};
use super::signal::Slice;
use super::{Curve, Figure, Formula, Limit, Line, Mistake, Signal, Unit};

/// A figure as it is drawn, without its curves.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct BoundFigure {
    pub(crate) id: String,
    pub(crate) group: String,
    pub(crate) title: String,
    /// The vertical axis.
    #[serde(flatten)]
    pub(crate) axis: Axis,
    pub(crate) limits: Vec<Level>,
    /// The horizontal axis, where it is not time.
    pub(crate) against: Option<Axis>,
    /// Whether it is an automatic figure of one field of one stream.
    pub(crate) signal: bool,
}

/// An axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Axis {
    pub(crate) unit: String,
    pub(crate) frame: String,
    /// The multiples of the unit that the axis may use; only one where the unit was chosen.
    pub(crate) scales: Vec<Scale>,
    /// Its quantity, where that is not the figure's title.
    pub(crate) name: String,
    /// The values of an enumeration with their names, which replace numbers at the axis.
    pub(crate) names: Vec<EnumValue>,
}

/// A horizontal line in the axis's unit.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Level {
    pub(crate) y: f64,
    pub(crate) text: String,
}

/// One curve of a binding.
#[derive(Debug, Clone)]
pub(crate) struct BoundCurve {
    pub(crate) label: String,
    /// Whole numbers are drawn as a zero-order hold.
    pub(crate) step: bool,
}

/// The source of one or several curves of a figure.
pub(crate) struct Binding {
    /// The figure's index in [`BoundFigures::figures`].
    pub(crate) figure: usize,
    /// The streams: the samples of the first are the instants, the others are resampled there.
    pub(crate) streams: Vec<usize>,
    pub(crate) evaluate: Evaluate,
    pub(crate) against: Option<(Evaluate, f64)>,
    pub(crate) curves: Vec<BoundCurve>,
    /// The factor from the unit of the fields to that of the axis.
    pub(crate) scale: f64,
    pub(crate) origin: String,
}

/// Figures with all sources of their curves.
#[derive(Default)]
pub(crate) struct BoundFigures {
    pub(crate) figures: Vec<BoundFigure>,
    pub(crate) bindings: Vec<Binding>,
    /// The index of a figure in the input list, and the parts of it that do not fit the streams.
    pub(crate) mistakes: Vec<(usize, Mistake)>,
}

/// The source of a curve in the streams.
struct CurveSource {
    streams: Vec<usize>,
    evaluate: Evaluate,
    width: usize,
    unit: String,
    frame: String,
    step: bool,
    names: Vec<EnumValue>,
    origin: String,
}

/// Binds `figures`; parts that the streams do not have are left out and reported. `limits` are drawn where a figure shows
/// their signal.
pub(crate) fn bind(
    figures: &[Figure],
    streams: &[StreamSpec],
    limits: &[Limit],
    signal: bool,
    bound: &mut BoundFigures,
) {
    for (at, figure) in figures.iter().enumerate() {
        let mut mistakes = Vec::new();
        if let Some((drawn, bindings)) = bind_figure(figure, streams, limits, bound.figures.len(), &mut mistakes) {
            bound.figures.push(BoundFigure { signal, ..drawn });
            bound.bindings.extend(bindings);
        }
        bound.mistakes.extend(mistakes.into_iter().map(|mistake| (at, mistake)));
    }
}

/// A figure with the curves that fit the streams.
fn bind_figure(
    figure: &Figure,
    streams: &[StreamSpec],
    limits: &[Limit],
    number: usize,
    mistakes: &mut Vec<Mistake>,
) -> Option<(BoundFigure, Vec<Binding>)> {
    let mut bindings = Vec::new();
    let mut first: Option<(Axis, String)> = None;
    for (at, curve) in figure.curves.iter().enumerate() {
        let fitted = find(curve, streams).and_then(|found| {
            let known = first.as_ref().map(|(axis, _)| &*axis.unit);
            let (unit, scale) = scale_of(&figure.unit, &found.unit, known)?;
            Ok((found, unit, scale))
        });
        match fitted {
            Ok((found, unit, scale)) => {
                let (axis, _) = first.get_or_insert_with(|| (axis_of(&figure.unit, unit, &found), found.unit.clone()));
                if axis.names != found.names {
                    axis.names.clear();
                }
                bindings.push(binding(curve, found, scale, number));
            }
            Err(reason) => mistakes.push(Mistake::new(format!("curves.{}", at + 1), reason)),
        }
    }
    let (axis, own) = first?;
    let mut against = None;
    if let Some(curve) = &figure.against {
        match bind_horizontal_axis(curve, streams, &mut bindings) {
            Ok(axis) => against = Some(axis),
            Err(reason) => {
                mistakes.push(Mistake::new("against".into(), reason));
                return None;
            }
        }
    }
    let mut levels = Vec::new();
    for (at, line) in figure.limits.iter().enumerate() {
        match level(line, &own, &axis.unit, &figure.unit) {
            Ok(level) => levels.push(level),
            Err(reason) => mistakes.push(Mistake::new(format!("limits.{}", at + 1), reason)),
        }
    }
    let set = limits
        .iter()
        .filter(|limit| figure.curves.iter().any(|curve| applies_to(limit, curve)));
    let lines = set.flat_map(|limit| &limit.lines);
    levels.extend(lines.filter_map(|line| level(line, &own, &axis.unit, &figure.unit).ok()));
    let drawn = BoundFigure {
        id: figure.id.clone(),
        group: figure.group.clone(),
        title: figure.title.clone(),
        axis,
        limits: levels,
        against,
        signal: false,
    };
    Some((drawn, bindings))
}

fn binding(curve: &Curve, found: CurveSource, scale: f64, figure: usize) -> Binding {
    let computed = match &curve.formula {
        Formula::Computed(computed) => computed.labels(),
        _ => Vec::new(),
    };
    let given = if curve.labels.is_empty() {
        &computed
    } else {
        &curve.labels
    };
    let curves = labels(given, found.width).into_iter().map(|label| BoundCurve {
        label,
        step: found.step,
    });
    Binding {
        figure,
        streams: found.streams,
        evaluate: found.evaluate,
        against: None,
        curves: curves.collect(),
        scale,
        origin: found.origin,
    }
}

/// Sets the horizontal axis of all bindings of a figure.
fn bind_horizontal_axis(curve: &Curve, streams: &[StreamSpec], bindings: &mut [Binding]) -> Result<Axis, String> {
    let mut axis = None;
    for binding in bindings {
        let mut found = find(curve, streams)?;
        if found.width != 1 {
            return Err(format!(
                "`{}` has {} components: name one of them, or its length",
                found.origin, found.width
            ));
        }
        // Its streams follow those of the curve.
        let places: Vec<usize> = found
            .streams
            .iter()
            .map(|stream| slot(&mut binding.streams, *stream))
            .collect();
        found.evaluate.remap_streams(&places);
        let name = match curve.labels.first() {
            Some(label) => label.clone(),
            None => found.origin.clone(),
        };
        let own = axis_of(&Unit::Own, found.unit.clone(), &found);
        axis = Some(Axis { name, ..own });
        binding.against = Some((found.evaluate, 1.0));
    }
    axis.ok_or_else(|| "there is no curve to draw against it".to_owned())
}

/// The index of a stream among those of a binding, where it is added if it is new.
fn slot(streams: &mut Vec<usize>, stream: usize) -> usize {
    streams.iter().position(|one| *one == stream).unwrap_or_else(|| {
        streams.push(stream);
        streams.len() - 1
    })
}

/// The signals of a formula, looked up in the streams one after the other.
struct Operands<'a> {
    all: &'a [StreamSpec],
    /// The streams found so far.
    used: Vec<usize>,
    names: Vec<String>,
}

impl Operands<'_> {
    /// A signal with at least `least` elements, and of the shape and the unit of `like`.
    fn operand(&mut self, signal: &Signal, like: Option<&Slice>, least: usize) -> Result<Operand, String> {
        let (stream, slice) = signal
            .find(self.all)
            .ok_or_else(|| signal.alternatives_text(self.all))?;
        let name = format!("{}.{}", self.all[stream].name(), signal_text(&slice));
        if slice.field.element.room().is_some() {
            let field = &slice.field;
            return Err(format!(
                "`{name}` is `{field}`, which has no place on an axis: export it, or measure its changes"
            ));
        }
        if slice.len < least {
            return Err(format!("`{name}` has {} elements, and {least} are needed", slice.len));
        }
        if let Some(like) = like {
            if like.len != slice.len {
                return Err(format!("`{name}` has {} elements, not {}", slice.len, like.len));
            }
            let (unit, needed) = (&slice.field.unit, &like.field.unit);
            if unit != needed {
                return Err(format!("`{name}` is in `{unit}`, not in `{needed}`"));
            }
        }
        self.names.push(name);
        Ok((slot(&mut self.used, stream), slice))
    }
}

/// The operands of a formula in the streams, and the properties of its result.
fn find(curve: &Curve, streams: &[StreamSpec]) -> Result<CurveSource, String> {
    let mut found = Operands {
        all: streams,
        used: Vec::new(),
        names: Vec::new(),
    };
    let mut operand = |signal: &Signal, like: Option<&Slice>, least: usize| found.operand(signal, like, least);
    let (evaluate, width, unit, lead) = match &curve.formula {
        Formula::Each(a) => {
            let a = operand(a, None, 1)?;
            let (width, unit, lead) = (a.1.len, a.1.field.unit.clone(), a.1.clone());
            (Evaluate::Each(a), width, unit, Some(lead))
        }
        Formula::Difference(a, b) => {
            let a = operand(a, None, 1)?;
            let b = operand(b, Some(&a.1), 1)?;
            let (width, unit, lead) = (a.1.len, a.1.field.unit.clone(), a.1.clone());
            (Evaluate::Difference(a, b), width, unit, Some(lead))
        }
        Formula::Norm(a) => {
            let a = operand(a, None, 1)?;
            let unit = a.1.field.unit.clone();
            (Evaluate::Norm(a), 1, unit, None)
        }
        Formula::Distance(a, b) => {
            let a = operand(a, None, 1)?;
            let b = operand(b, Some(&a.1), 1)?;
            let unit = a.1.field.unit.clone();
            (Evaluate::Distance(a, b), 1, unit, None)
        }
        Formula::Angle(a, b) => (
            Evaluate::Angle(operand(a, None, 4)?, operand(b, None, 4)?),
            1,
            "rad".to_owned(),
            None,
        ),
        Formula::PositionIn(p, origin, axes) => {
            let p = operand(p, None, 3)?;
            let origin = operand(origin, Some(&p.1), 3)?;
            let unit = p.1.field.unit.clone();
            (Evaluate::PositionIn(p, origin, operand(axes, None, 4)?), 3, unit, None)
        }
        Formula::AttitudeIn(attitude, axes) => {
            let (attitude, axes) = (operand(attitude, None, 4)?, operand(axes, None, 4)?);
            (Evaluate::AttitudeIn(attitude, axes), 3, "1".to_owned(), None)
        }
        Formula::RotationVector(a) => (
            Evaluate::RotationVector(operand(a, None, 4)?),
            3,
            "rad".to_owned(),
            None,
        ),
        Formula::Computed(computed) => {
            let (participant, port) = computed.stream();
            let of = |spec: &StreamSpec| spec.participant == participant && spec.port == port;
            found.used = vec![streams.iter().position(of).ok_or("the stream is not there")?];
            found.names = vec![computed.origin()];
            (
                Evaluate::Computed(computed.clone()),
                computed.labels().len(),
                "1".to_owned(),
                None,
            )
        }
    };
    let whole = |element: Element| !matches!(element, Element::F64 | Element::F32);
    Ok(CurveSource {
        streams: found.used,
        evaluate,
        width,
        unit,
        frame: lead.as_ref().map(|slice| slice.field.frame.clone()).unwrap_or_default(),
        names: lead
            .as_ref()
            .map(|slice| slice.field.values.clone())
            .unwrap_or_default(),
        step: lead.is_some_and(|slice| whole(slice.field.element)),
        origin: found.names.join(", "),
    })
}

/// The name of the field or the element as written in the formula.
fn signal_text(slice: &Slice) -> String {
    let field = &slice.field;
    match slice.len {
        len if len == field.len() => field.name.clone(),
        1 => field.element_name(slice.from),
        len => format!("{}[{}..{}]", field.name, slice.from, slice.from + len),
    }
}

/// The unit of an axis, and the factor from the unit of the fields.
fn scale_of(wanted: &Unit, own: &str, known: Option<&str>) -> Result<(String, f64), String> {
    let unit = match (wanted, known) {
        (Unit::Scaled(unit, scale), _) => return Ok((unit.clone(), *scale)),
        (Unit::Named(unit), _) => unit.as_str(),
        (Unit::Own, Some(known)) => known,
        (Unit::Own, None) => own,
    };
    if unit == own {
        return Ok((unit.to_owned(), 1.0));
    }
    let converted = units::convert(&format!("1 {own}"), unit);
    let converted = converted.map_err(|_| format!("is in `{own}`, which does not fit `{unit}`"))?;
    Ok((unit.to_owned(), converted.0[0]))
}

fn axis_of(wanted: &Unit, unit: String, found: &CurveSource) -> Axis {
    let scales = match wanted {
        Unit::Named(_) => vec![Scale {
            exponent: 0,
            name: if unit == "1" { String::new() } else { unit.clone() },
        }],
        Unit::Own | Unit::Scaled(..) => scales(&unit),
    };
    Axis {
        scales,
        frame: found.frame.clone(),
        unit,
        name: String::new(),
        names: found.names.clone(),
    }
}

fn level(line: &Line, own: &str, unit: &str, wanted: &Unit) -> Result<Level, String> {
    let scale = scale_of(wanted, own, Some(unit))?.1;
    let y = match &line.at {
        Value::Float(x) => *x,
        Value::Integer(x) => *x as f64,
        Value::String(text) => {
            let (values, _) = units::convert(text, own).map_err(|error| error.to_string())?;
            match values[..] {
                [value] => value,
                _ => return Err(format!("`{text}` is not one value")),
            }
        }
        other => return Err(format!("`{other}` is not a quantity such as \"5 {own}\"")),
    };
    let text = line.text.clone();
    Ok(Level { y: y * scale, text })
}

/// Whether a limit applies to the signal of a curve.
fn applies_to(limit: &Limit, curve: &Curve) -> bool {
    let (of, minus, through) = match &curve.formula {
        Formula::Each(of) => (of, None, None),
        Formula::Difference(of, minus) => (of, Some(minus), None),
        Formula::Norm(of) => (of, None, Some("norm")),
        Formula::Distance(of, minus) => (of, Some(minus), Some("norm")),
        Formula::Angle(of, to) => (of, Some(to), Some("angle")),
        _ => return false,
    };
    let same = |a: &Signal, b: &Signal| {
        let bare = |signal: &Signal| {
            signal
                .names
                .first()
                .map(|name| name.split('[').next().unwrap_or(name).to_owned())
        };
        a.port == b.port
            && a.participant == b.participant
            && (a.names == b.names || bare(a).as_ref() == b.names.first())
    };
    same(&limit.of, of)
        && limit.through.as_deref() == through
        && match (&limit.minus, minus) {
            (None, None) => true,
            (Some(a), Some(b)) => same(a, b),
            _ => false,
        }
}

/// One label for each of `count` curves.
fn labels(given: &[String], count: usize) -> Vec<String> {
    let axes = ["x", "y", "z"];
    (0..count)
        .map(|i| match given.get(i) {
            Some(label) if given.len() == count => label.clone(),
            Some(_) if given.len() == 1 && count == 3 => format!("{} {}", given[0], axes[i]),
            _ if given.len() == 1 && count > 3 => format!("{} {}", given[0], i + 1),
            Some(label) => label.clone(),
            None if count == 3 => axes[i].to_owned(),
            None if count == 1 => String::new(),
            None => format!("{}", i + 1),
        })
        .collect()
}
