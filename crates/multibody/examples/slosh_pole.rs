//! Draws the figures of `docs/slosh.md`: the bob passes the pole of the first hinge, with the paper's two hinges and with the
//! spherical pendulum.
//!
//! `cargo run --release -p multibody --example slosh_pole -- docs/figures`

use multibody::{Description, Method, SloshState, SloshTree, SphericalSlosh, State, Tree, from_two_hinges, rk4};
use nalgebra::{SVector, Vector3};
use std::fmt::Write;

const H: f64 = 1e-3;
const RATE: f64 = 1.0;

struct Run {
    /// (t, |first hinge rate|, |w| of the spherical pendulum).
    rates: Vec<(f64, f64, f64)>,
    /// (t, angle between the bobs, rad).
    apart: Vec<(f64, f64)>,
    /// Largest relative energy error of each.
    energy: (f64, f64),
    /// Damper energy of each over the initial kinetic energy.
    damped: (f64, f64),
}

/// The bob swings from straight down towards +y, which it passes at about `miss` rad; base and arm are initially at rest.
/// `axial` is the bob's inertia about its rod.
fn run(miss: f64, axial: f64, damping: f64) -> Run {
    let text = include_str!("../../../models/servicer.urdf");
    let mut hinged = Description::from_urdf(text).expect("valid");
    for joint in ["slosh_y", "slosh_x"] {
        hinged.set_damping(joint, damping).expect("it exists");
    }
    let bob = hinged.links.iter_mut().find(|l| l.name == "slosh_bob").expect("a bob");
    bob.inertia.as_mut().expect("with inertia").about_com[(2, 2)] = axial;
    let hinged = Tree::<9, 15>::new(&hinged).expect("valid");
    let mut rest = Description::from_urdf(text).expect("valid");
    rest.remove_branch("slosh_gimbal").expect("it exists");
    let slosh = SphericalSlosh {
        hinge: Vector3::new(0.0, 0.0, -0.15),
        mass: 10.61,
        length: 0.1317,
        inertia: 0.002,
        damping,
        stiffness: 0.0,
        rest: -Vector3::z(),
    };
    let spherical = SloshTree::new(Tree::<7, 13>::new(&rest).expect("valid"), slosh).expect("valid");

    let mut a = State::<9, 15>::rest();
    a.q = SVector::from_column_slice(&[0.0, 0.7, 0.0, 1.4, 0.0, 0.7, 0.0, 0.0, 0.9]);
    a.nu[13] = miss * RATE;
    a.nu[14] = RATE;
    let (d, w) = from_two_hinges([a.q[7], a.q[8]], [a.nu[13], a.nu[14]]);
    let tree = State {
        q: a.q.fixed_rows::<7>(0).into(),
        ..State::rest()
    };
    let mut b = SloshState { tree, d, w };

    let hinged_energy = |s: &State<9, 15>| hinged.kinetic_energy(&hinged.kinematics(&s.q, &s.nu));
    let (ea, eb) = (hinged_energy(&a), spherical.kinetic_energy(&b));
    let mut out = Run {
        rates: vec![],
        apart: vec![],
        energy: (0.0, 0.0),
        damped: (0.0, 0.0),
    };
    for step in 0..1500_u32 {
        let t = f64::from(step) * H;
        let (direction, _) = from_two_hinges([a.q[7], a.q[8]], [0.0, 0.0]);
        out.rates.push((t, a.nu[13].abs(), b.w.norm()));
        let sine = direction.cross(&b.d).norm();
        out.apart.push((t, libm::atan2(sine, direction.dot(&b.d))));
        out.damped.0 -= H * hinged.damper_power(&a.nu) / ea;
        out.damped.1 -= H * spherical.damper_power(&b) / eb;
        a = hinged.step(Method::Rk4, &a, &SVector::zeros(), H);
        b = rk4(&spherical, &b, &SVector::zeros(), H);
        out.energy.0 = out.energy.0.max((hinged_energy(&a) - ea).abs() / ea);
        out.energy.1 = out.energy.1.max((spherical.kinetic_energy(&b) - eb).abs() / eb);
    }
    out
}

fn main() -> std::io::Result<()> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "docs/figures".to_owned());
    std::fs::create_dir_all(&folder)?;
    let near = run(0.01, 0.0, 0.0);
    let pick = |f: &dyn Fn(&(f64, f64, f64)) -> f64| near.rates.iter().map(|r| (r.0, f(r))).collect::<Vec<_>>();
    let rates = [
        Curve::new("first hinge (two hinges)", pick(&|r| r.1)),
        Curve::new("bob (spherical)", pick(&|r| r.2)),
    ];
    std::fs::write(
        format!("{folder}/slosh-rates.svg"),
        plot(
            "Rates past the pole",
            "time (s)",
            "rate (rad/s)",
            &rates,
            Scale::Linear,
            Scale::Log,
        ),
    )?;

    let misses: Vec<f64> = (0..=24).map(|i| libm::pow(10.0, -2.6 + 0.1 * f64::from(i))).collect();
    let runs: Vec<(f64, Run)> = misses.iter().map(|&m| (m, run(m, 0.0, 0.0))).collect();
    let of = |f: &dyn Fn(&Run) -> f64| runs.iter().map(|(m, r)| (*m, f(r).max(1e-16))).collect::<Vec<_>>();
    let energy = [
        Curve::new("two hinges", of(&|r| r.energy.0)),
        Curve::new("spherical", of(&|r| r.energy.1)),
    ];
    std::fs::write(
        format!("{folder}/slosh-energy.svg"),
        plot(
            "RK4 at 1 ms: energy",
            "miss of the pole (rad)",
            "relative error",
            &energy,
            Scale::Log,
            Scale::Log,
        ),
    )?;

    let runs: Vec<(f64, Run)> = misses.iter().map(|&m| (m, run(m, 0.002, 0.0131))).collect();
    let of = |f: &dyn Fn(&Run) -> f64| runs.iter().map(|(m, r)| (*m, f(r))).collect::<Vec<_>>();
    let damped = [
        Curve::new("two hinges", of(&|r| r.damped.0)),
        Curve::new("spherical", of(&|r| r.damped.1)),
    ];
    std::fs::write(
        format!("{folder}/slosh-damping.svg"),
        plot(
            "Energy the dampers take",
            "miss of the pole (rad)",
            "share",
            &damped,
            Scale::Log,
            Scale::Linear,
        ),
    )?;

    println!(
        "miss (rad)   hinge rate (rad/s)   energy error: hinges, spherical   apart (rad)   stock bob: damped hinges, spherical"
    );
    for miss in [0.3, 0.1, 0.03, 0.01, 0.003, 0.001] {
        let r = run(miss, 0.0, 0.0);
        let fastest = r.rates.iter().map(|r| r.1).fold(0.0, f64::max);
        let apart = r.apart.iter().map(|a| a.1).fold(0.0, f64::max);
        let s = run(miss, 0.002, 0.0131);
        println!(
            "{miss:<12} {fastest:<20.1e} {:.1e}, {:.1e}                {apart:<13.1e} {:.4}, {:.4}",
            r.energy.0, r.energy.1, s.damped.0, s.damped.1
        );
    }
    Ok(())
}

struct Curve {
    name: &'static str,
    points: Vec<(f64, f64)>,
}

impl Curve {
    fn new(name: &'static str, points: Vec<(f64, f64)>) -> Self {
        Self { name, points }
    }
}

#[derive(Clone, Copy, PartialEq)]
enum Scale {
    Linear,
    Log,
}

/// One axis: from data to the unit interval, and its ticks.
struct Axis {
    scale: Scale,
    low: f64,
    high: f64,
}

impl Axis {
    fn new(scale: Scale, values: impl Iterator<Item = f64> + Clone) -> Self {
        let (low, high) = values
            .clone()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
        match scale {
            Scale::Linear => Self {
                scale,
                low: low.min(0.0),
                high: 1.05 * high,
            },
            Scale::Log => {
                let low = values.filter(|v| *v > 0.0).fold(f64::INFINITY, f64::min);
                Self {
                    scale,
                    low: libm::floor(libm::log10(low)),
                    high: libm::ceil(libm::log10(high)),
                }
            }
        }
    }

    fn at(&self, x: f64) -> f64 {
        let x = if self.scale == Scale::Log {
            libm::log10(x.max(libm::pow(10.0, self.low)))
        } else {
            x
        };
        (x - self.low) / (self.high - self.low)
    }

    fn ticks(&self) -> Vec<(f64, String)> {
        match self.scale {
            Scale::Log => {
                let every = ((self.high - self.low) / 8.0).ceil().max(1.0) as usize;
                let decades = (self.low as i32..=self.high as i32).step_by(every);
                decades
                    .map(|d| (libm::pow(10.0, f64::from(d)), format!("1e{d}")))
                    .collect()
            }
            Scale::Linear => {
                let step = libm::pow(10.0, libm::floor(libm::log10(self.high - self.low)));
                let step = if (self.high - self.low) / step < 3.0 {
                    step / 5.0
                } else {
                    step
                };
                let count = ((self.high - self.low) / step) as usize;
                (0..=count)
                    .map(|i| self.low + step * i as f64)
                    .map(|v| {
                        (
                            v,
                            format!("{:.3}", v)
                                .trim_end_matches('0')
                                .trim_end_matches('.')
                                .to_owned(),
                        )
                    })
                    .collect()
            }
        }
    }
}

fn plot(title: &str, x_label: &str, y_label: &str, curves: &[Curve], xs: Scale, ys: Scale) -> String {
    const COLOURS: [&str; 2] = ["#c0392b", "#1f5fa8"];
    let (left, top, width, height) = (70.0, 40.0, 520.0, 280.0);
    let x = Axis::new(xs, curves.iter().flat_map(|c| c.points.iter().map(|p| p.0)));
    let y = Axis::new(ys, curves.iter().flat_map(|c| c.points.iter().map(|p| p.1)));
    let (px, py) = (|v: f64| left + width * x.at(v), |v: f64| top + height * (1.0 - y.at(v)));
    let mut s = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 620 380\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"620\" height=\"380\" fill=\"white\"/>\n",
    );
    let mut line = |text: String| {
        let _ = writeln!(s, "{text}"); // writing to a String cannot fail
    };
    line(format!("<text x=\"{left}\" y=\"24\" font-size=\"15\">{title}</text>"));
    for (v, label) in x.ticks() {
        let at = px(v);
        line(format!(
            "<line x1=\"{at:.1}\" y1=\"{top}\" x2=\"{at:.1}\" y2=\"{}\" stroke=\"#ddd\"/>",
            top + height
        ));
        line(format!(
            "<text x=\"{at:.1}\" y=\"{}\" text-anchor=\"middle\">{label}</text>",
            top + height + 16.0
        ));
    }
    for (v, label) in y.ticks() {
        let at = py(v);
        line(format!(
            "<line x1=\"{left}\" y1=\"{at:.1}\" x2=\"{}\" y2=\"{at:.1}\" stroke=\"#ddd\"/>",
            left + width
        ));
        line(format!(
            "<text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{label}</text>",
            left - 6.0,
            at + 4.0
        ));
    }
    line(format!(
        "<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"#444\"/>"
    ));
    for (i, (curve, colour)) in curves.iter().zip(COLOURS).enumerate() {
        let points: Vec<String> = curve
            .points
            .iter()
            .map(|p| format!("{:.1},{:.1}", px(p.0), py(p.1)))
            .collect();
        line(format!(
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.8\"/>",
            points.join(" ")
        ));
        let from = left + width - 300.0 + 190.0 * i as f64;
        line(format!(
            "<line x1=\"{from}\" y1=\"20\" x2=\"{}\" y2=\"20\" stroke=\"{colour}\" stroke-width=\"3\"/>",
            from + 24.0
        ));
        line(format!("<text x=\"{}\" y=\"24\">{}</text>", from + 30.0, curve.name));
    }
    line(format!(
        "<text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{x_label}</text>",
        left + width / 2.0,
        top + height + 36.0
    ));
    line(format!(
        "<text transform=\"translate(18 {}) rotate(-90)\" text-anchor=\"middle\">{y_label}</text>",
        top + height / 2.0
    ));
    s + "</svg>\n"
}
