//! The table `[report]` of a scenario.

use lockstep::time::Rational;
use serde::Deserialize;
use tape::StreamSpec;
use toml::{Table, Value};

use super::{BoundFigures, Curve, Figure, Formula, Line, Mistake, Signal, Unit, View, bind};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ReportEntry {
    #[serde(default)]
    panels: Vec<Value>,
    #[serde(default)]
    marks: std::collections::BTreeMap<String, Rational>,
}

/// `[[report.panels]]`
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PanelEntry {
    name: Option<String>,
    title: Option<String>,
    group: Option<String>,
    unit: Option<String>,
    curves: Vec<Value>,
    against: Option<Value>,
    #[serde(default)]
    limits: Vec<Value>,
}

/// A curve that is not a plain signal.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct CurveEntry {
    of: String,
    minus: Option<String>,
    angle_to: Option<String>,
    in_axes_of: Option<String>,
    #[serde(default)]
    norm: bool,
    #[serde(default)]
    rotation_vector: bool,
    label: Option<String>,
}

/// The default heading of panels.
const GROUP: &str = "Panels";

impl View {
    /// Reads the table `[report]`, checked as far as possible without the streams.
    ///
    /// # Errors
    /// Every mistake, with its key below the table.
    pub fn read(table: &Table) -> Result<View, Vec<Mistake>> {
        let read = serde_path_to_error::deserialize::<_, ReportEntry>(Value::Table(table.clone()));
        let entry = read.map_err(|error| vec![refused("", &error)])?;
        let (mut figures, mut mistakes) = (Vec::<Figure>::new(), Vec::new());
        for (at, panel) in entry.panels.into_iter().enumerate() {
            let key = format!("panels.{}", at + 1);
            let made = serde_path_to_error::deserialize::<_, PanelEntry>(panel)
                .map_err(|error| refused(&key, &error))
                .and_then(|entry| {
                    figure(entry, at).map_err(|mistake| Mistake::new(below(&key, &mistake.key), mistake.reason))
                });
            match made {
                Ok(figure) if figures.iter().any(|one| one.id == figure.id) => {
                    let reason = format!("there are two panels `{}`: give one of them another name", figure.id);
                    mistakes.push(Mistake::new(below(&key, "name"), reason));
                }
                Ok(figure) => figures.push(figure),
                Err(mistake) => mistakes.push(mistake),
            }
        }
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        Ok(View {
            figures,
            marks: entry.marks.into_iter().collect(),
            ..View::default()
        })
    }

    /// The participants that curves refer to, each with the key of the curve.
    pub fn participants(&self) -> impl Iterator<Item = (String, &str)> {
        self.figures.iter().enumerate().flat_map(|(at, figure)| {
            let along = figure.against.iter().map(|curve| ("against".to_owned(), curve));
            let curves = figure.curves.iter().enumerate();
            let curves = curves
                .map(|(at, curve)| (format!("curves.{}", at + 1), curve))
                .chain(along);
            curves.flat_map(move |(key, curve)| {
                let key = format!("panels.{}.{key}", at + 1);
                let names = curve
                    .formula
                    .signals()
                    .into_iter()
                    .filter_map(|signal| signal.participant.as_deref());
                names.map(move |name| (key.clone(), name))
            })
        })
    }

    /// The parts of the view that do not fit these streams. A figure with a signal of a participant that is not `certain`
    /// is left out.
    pub fn mismatches(&self, streams: &[StreamSpec], certain: impl Fn(&str) -> bool) -> Vec<Mistake> {
        let known = |signal: &Signal| signal.participant.as_deref().is_none_or(&certain);
        let mut mistakes = Vec::new();
        for (at, figure) in self.figures.iter().enumerate() {
            let curves = figure.curves.iter().chain(&figure.against);
            if !curves.flat_map(|curve| curve.formula.signals()).all(known) {
                continue;
            }
            let mut bound = BoundFigures::default();
            bind(std::slice::from_ref(figure), streams, &[], false, &mut bound);
            let found = bound.mistakes.into_iter().map(|(_, mistake)| mistake);
            mistakes.extend(found.map(|one| Mistake::new(format!("panels.{}.{}", at + 1, one.key), one.reason)));
        }
        mistakes
    }
}

impl Formula {
    /// The signals that it needs.
    pub(crate) fn signals(&self) -> Vec<&Signal> {
        match self {
            Formula::Each(a) | Formula::Norm(a) | Formula::RotationVector(a) => vec![a],
            Formula::Difference(a, b) | Formula::Distance(a, b) | Formula::Angle(a, b) | Formula::AttitudeIn(a, b) => {
                vec![a, b]
            }
            Formula::PositionIn(a, b, c) => vec![a, b, c],
            Formula::Computed(_) => Vec::new(),
        }
    }
}

pub(crate) fn below(key: &str, inner: &str) -> String {
    match (key, inner) {
        (key, "" | ".") => key.to_owned(),
        ("", inner) => inner.to_owned(),
        (key, inner) => format!("{key}.{inner}"),
    }
}

fn refused(key: &str, error: &serde_path_to_error::Error<toml::de::Error>) -> Mistake {
    Mistake::new(below(key, &error.path().to_string()), error.inner().message())
}

fn figure(entry: PanelEntry, at: usize) -> Result<Figure, Mistake> {
    let id = entry.name.unwrap_or_else(|| format!("panel-{}", at + 1));
    let plain = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if id.is_empty() || !id.chars().all(plain) {
        return Err(Mistake::new(
            "name".into(),
            format!("`{id}`: a name has letters, digits, `-` and `_` only"),
        ));
    }
    if entry.curves.is_empty() {
        let reason = "there is nothing to draw: write a list such as [\"plant.motion.position\"]";
        return Err(Mistake::new("curves".into(), reason));
    }
    let curves = entry.curves.into_iter().enumerate();
    let curves = curves.map(|(at, value)| curve(&format!("curves.{}", at + 1), value));
    let curves = curves.collect::<Result<Vec<Curve>, Mistake>>()?;
    let against = entry.against.map(|value| curve("against", value)).transpose()?;
    let limits = entry.limits.into_iter().map(|at| Line {
        at,
        text: "limit".to_owned(),
    });
    Ok(Figure {
        title: entry.title.unwrap_or_else(|| id.replace(['-', '_'], " ")),
        group: entry.group.unwrap_or_else(|| GROUP.to_owned()),
        unit: entry.unit.map_or(Unit::Own, Unit::Named),
        curves,
        against,
        limits: limits.collect(),
        id,
    })
}

fn signal(key: String, text: &str) -> Result<Signal, Mistake> {
    Signal::named(text).ok_or_else(|| {
        let reason = format!(
            "`{text}` is not a signal: write PARTICIPANT.OUTPUT.FIELD, such as \"plant.motion.position\" or \"plant.truth.q[2]\""
        );
        Mistake::new(key, reason)
    })
}

/// A curve: the name of a signal, or a table.
fn curve(key: &str, value: Value) -> Result<Curve, Mistake> {
    if let Value::String(text) = &value {
        return Ok(Curve {
            formula: Formula::Each(signal(key.to_owned(), text)?),
            labels: vec![short(text)],
        });
    }
    if !value.is_table() {
        let reason = format!(
            "`{value}` is not a curve: write a signal such as \"plant.motion.position\", or {{ of = …, minus = … }}"
        );
        return Err(Mistake::new(key.to_owned(), reason));
    }
    let entry = serde_path_to_error::deserialize::<_, CurveEntry>(value).map_err(|error| refused(key, &error))?;
    let other =
        |name: &str, text: &Option<String>| text.as_deref().map(|text| signal(below(key, name), text)).transpose();
    let of = signal(below(key, "of"), &entry.of)?;
    let minus = other("minus", &entry.minus)?;
    let angle = other("angle-to", &entry.angle_to)?;
    let axes = other("in-axes-of", &entry.in_axes_of)?;
    let formula = match (minus, angle, axes, entry.norm, entry.rotation_vector) {
        (None, None, None, false, false) => Formula::Each(of),
        (Some(minus), None, None, false, false) => Formula::Difference(of, minus),
        (None, None, None, true, false) => Formula::Norm(of),
        (Some(minus), None, None, true, false) => Formula::Distance(of, minus),
        (None, Some(to), None, false, false) => Formula::Angle(of, to),
        (Some(minus), None, Some(axes), false, false) => Formula::PositionIn(of, minus, axes),
        (None, None, Some(axes), false, false) => Formula::AttitudeIn(of, axes),
        (None, None, None, false, true) => Formula::RotationVector(of),
        _ => {
            let reason = "these do not go together: write `minus` with `norm` or with `in-axes-of`, or one of `minus`, `norm`, \
                          `angle-to`, `in-axes-of` and `rotation-vector` alone";
            return Err(Mistake::new(key.to_owned(), reason));
        }
    };
    let words = match &formula {
        Formula::Difference(..) | Formula::PositionIn(..) => format!(
            "{} − {}",
            short(&entry.of),
            short(entry.minus.as_deref().unwrap_or_default())
        ),
        Formula::Norm(_) => format!("|{}|", short(&entry.of)),
        Formula::Distance(..) => format!(
            "|{} − {}|",
            short(&entry.of),
            short(entry.minus.as_deref().unwrap_or_default())
        ),
        Formula::Angle(..) => format!(
            "{} to {}",
            short(&entry.of),
            short(entry.angle_to.as_deref().unwrap_or_default())
        ),
        _ => short(&entry.of),
    };
    Ok(Curve {
        formula,
        labels: vec![entry.label.unwrap_or(words)],
    })
}

/// The label of a signal: participant and field, since the port adds little information.
fn short(text: &str) -> String {
    let parts: Vec<&str> = text.splitn(3, '.').collect();
    match parts[..] {
        [participant, _, field] => format!("{participant} {field}"),
        _ => text.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use lockstep::port::{Descriptor, Element, Field};

    use super::*;

    fn streams() -> Vec<StreamSpec> {
        let field = |name: &str, shape: &[u32], unit: &str, offset| Field {
            name: name.into(),
            element: Element::F64,
            shape: shape.into(),
            unit: unit.into(),
            frame: String::new(),
            offset,
            values: Vec::new(),
        };
        let fields = vec![
            field("x", &[3], "m", 0),
            field("v", &[3], "m/s", 24),
            field("q", &[4], "1", 48),
            field("h", &[], "m", 80),
        ];
        let descriptor = Descriptor {
            name: "S".into(),
            size: 88,
            fields,
        };
        let of = |name: &str, ms| {
            StreamSpec::new(
                name,
                "state",
                descriptor.clone(),
                Rational::ZERO,
                Rational::from_millis(ms),
            )
        };
        vec![of("cart", 10), of("guide", 3)]
    }

    fn mistakes_in(text: &str) -> Vec<String> {
        let table: Table = text.parse().unwrap();
        let wrong = match View::read(&table) {
            Ok(view) => view.mismatches(&streams(), |_| true),
            Err(wrong) => wrong,
        };
        wrong
            .into_iter()
            .map(|one| format!("{}: {}", one.key, one.reason))
            .collect()
    }

    #[test]
    fn view_reader_accepts_every_kind_of_curve() {
        let all = r#"
            marks = { turn = "2 s" }
            [[panels]]
            title = "All"
            curves = ["cart.state.x", "cart.state.x[2]", { of = "cart.state.x", minus = "guide.state.x" }, { of = "cart.state.x", norm = true },
                { of = "cart.state.x", minus = "guide.state.x", norm = true, label = "apart" },
                { of = "cart.state.x", minus = "guide.state.x", in-axes-of = "guide.state.q" }, "cart.state.h"]
            limits = ["5 mm", "-5 mm"]
            unit = "mm"
            [[panels]]
            name = "turn"
            curves = [{ of = "cart.state.q", angle-to = "guide.state.q" }, { of = "cart.state.q", rotation-vector = true }]
            unit = "deg"
            [[panels]]
            name = "path"
            curves = ["cart.state.x[1]"]
            against = { of = "cart.state.x[0]", label = "along" }
        "#;
        assert_eq!(mistakes_in(all), [""; 0]);
        let view = View::read(&all.parse().unwrap()).unwrap();
        let mut bound = BoundFigures::default();
        bind(&view.figures, &streams(), &[], false, &mut bound);
        let ids: Vec<&str> = bound.figures.iter().map(|figure| &*figure.id).collect();
        assert_eq!(ids, ["panel-1", "turn", "path"]);
        assert_eq!(
            bound.figures[0].limits.iter().map(|limit| limit.y).collect::<Vec<_>>(),
            [5.0, -5.0]
        );
        assert_eq!(bound.figures[2].against.as_ref().unwrap().name, "along");
        assert_eq!(bound.bindings[0].scale, 1000.0);
    }

    #[test]
    fn view_mistakes_name_their_keys() {
        for (table, expected) in [
            (
                "[[panels]]\ncurves = ['cart.state.y']",
                "panels.1.curves.1: `cart.state` has no field or element `y`; it has `x[3]`, `v[3]`, `q[4]`, `h`",
            ),
            (
                "[[panels]]\ncurves = ['cart.state.x[3]']",
                "panels.1.curves.1: `cart.state` has no field or element `x[3]`",
            ),
            (
                "[[panels]]\ncurves = ['cart.motion.x']",
                "panels.1.curves.1: `cart` has no output `motion`; it has `state`",
            ),
            (
                "[[panels]]\ncurves = ['car.state.x']",
                "panels.1.curves.1: there is no participant `car` with outputs; there is `cart`, `guide`",
            ),
            (
                "[[panels]]\ncurves = ['x']",
                "panels.1.curves.1: `x` is not a signal: write PARTICIPANT.OUTPUT.FIELD",
            ),
            ("[[panels]]\ncurves = [3]", "panels.1.curves.1: `3` is not a curve"),
            ("[[panels]]\ncurves = []", "panels.1.curves: there is nothing to draw"),
            ("[[panels]]\ntitle = 'x'", "panels.1: missing field `curves`"),
            (
                "[[panels]]\ncurve = ['cart.state.x']",
                "panels.1.curve: unknown field `curve`",
            ),
            (
                "[[panels]]\ncurves = [{ of = 'cart.state.x', les = 'x' }]",
                "panels.1.curves.1.les: unknown field `les`",
            ),
            (
                "[[panels]]\ncurves = [{ of = 'cart.state.x', minus = 'cart.state.h' }]",
                "panels.1.curves.1: `cart.state.h` has 1 elements, not 3",
            ),
            (
                "[[panels]]\ncurves = [{ of = 'cart.state.x', minus = 'cart.state.v' }]",
                "panels.1.curves.1: `cart.state.v` is in `m/s`, not in `m`",
            ),
            (
                "[[panels]]\ncurves = [{ of = 'cart.state.x', angle-to = 'cart.state.q' }]",
                "panels.1.curves.1: `cart.state.x` has 3 elements, and 4 are needed",
            ),
            (
                "[[panels]]\ncurves = [{ of = 'cart.state.x', norm = true, rotation-vector = true }]",
                "panels.1.curves.1: these do not go together",
            ),
            (
                "[[panels]]\ncurves = ['cart.state.x', 'cart.state.v']",
                "panels.1.curves.2: is in `m/s`, which does not fit `m`",
            ),
            (
                "[[panels]]\nunit = 'kg'\ncurves = ['cart.state.x']",
                "panels.1.curves.1: is in `m`, which does not fit `kg`",
            ),
            (
                "[[panels]]\ncurves = ['cart.state.x']\nlimits = ['3 s']",
                "panels.1.limits.1: ",
            ),
            (
                "[[panels]]\ncurves = ['cart.state.x']\nagainst = 'guide.state.x'",
                "panels.1.against: `guide.state.x` has 3 components",
            ),
            (
                "[[panels]]\nname = 'a b'\ncurves = ['cart.state.x']",
                "panels.1.name: `a b`: a name has letters",
            ),
            (
                "[[panels]]\nname = 'a'\ncurves = ['cart.state.x']\n[[panels]]\nname = 'a'\ncurves = ['cart.state.x']",
                "panels.2.name: there are two panels `a`",
            ),
            ("marks = { turn = 3.5 }", "marks.turn: "),
        ] {
            let wrong = mistakes_in(table);
            assert_eq!(wrong.len(), 1, "{table}: {wrong:?}");
            assert!(wrong[0].starts_with(expected), "{table}: {}", wrong[0]);
        }
    }
}
