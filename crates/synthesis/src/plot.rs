//! Curves over frequency as SVG text: both axes logarithmic, no dependency, opens in any browser.

use std::fmt::Write;

/// One curve.
#[derive(Debug, Clone)]
pub struct Curve {
    /// Its name in the legend.
    pub name: String,
    /// Points (ω, value), ascending in ω; what is not positive and finite is left out.
    pub points: Vec<(f64, f64)>,
    /// Whether it is drawn dashed: bounds and weights.
    pub dashed: bool,
}

const COLOURS: [&str; 8] = [
    "#1b6ca8", "#c8553d", "#3a7d44", "#8e5572", "#b8860b", "#4b4e6d", "#00798c", "#d1495b",
];
const WIDTH: f64 = 760.0;
const HEIGHT: f64 = 460.0;
const MARGIN: f64 = 60.0;

/// A figure with a title and named axes.
pub fn figure(title: &str, x_name: &str, y_name: &str, curves: &[Curve]) -> String {
    let usable = |p: &&(f64, f64)| p.0 > 0.0 && p.0.is_finite() && p.1 > 0.0 && p.1.is_finite();
    let all: Vec<(f64, f64)> = curves
        .iter()
        .flat_map(|c| c.points.iter().filter(usable).copied())
        .collect();
    let span = |pick: fn(&(f64, f64)) -> f64| {
        let (low, high) = all
            .iter()
            .map(pick)
            .fold((f64::INFINITY, 0.0f64), |(a, b), v| (a.min(v), b.max(v)));
        if low < high {
            (low.log10().floor(), high.log10().ceil())
        } else {
            (-1.0, 1.0)
        }
    };
    let ((x0, x1), (mut y0, y1)) = (span(|p| p.0), span(|p| p.1));
    // Curves that fall to nothing would flatten everything else.
    y0 = y0.max(y1 - 6.0);
    let x = |v: f64| MARGIN + (v.log10() - x0) / (x1 - x0) * (WIDTH - 2.0 * MARGIN);
    let y = |v: f64| HEIGHT - MARGIN - (v.log10() - y0) / (y1 - y0) * (HEIGHT - 2.0 * MARGIN);
    let mut svg = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        svg,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" font-family=\"sans-serif\" font-size=\"12\">\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text x=\"{}\" y=\"24\" text-anchor=\"middle\" font-size=\"15\">{}</text>\n\
         <text x=\"{}\" y=\"{}\" text-anchor=\"middle\">{}</text>\n\
         <text x=\"16\" y=\"{}\" text-anchor=\"middle\" transform=\"rotate(-90 16 {})\">{}</text>",
        WIDTH / 2.0,
        escape(title),
        WIDTH / 2.0,
        HEIGHT - 16.0,
        escape(x_name),
        HEIGHT / 2.0,
        HEIGHT / 2.0,
        escape(y_name)
    );
    for decade in x0 as i32..=x1 as i32 {
        let at = x(10f64.powi(decade));
        let _ = writeln!(
            svg,
            "<path d=\"M{at:.1} {MARGIN}V{:.1}\" stroke=\"#ddd\"/><text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\">1e{decade}</text>",
            HEIGHT - MARGIN,
            HEIGHT - MARGIN + 16.0
        );
    }
    for decade in y0 as i32..=y1 as i32 {
        let at = y(10f64.powi(decade));
        let _ = writeln!(
            svg,
            "<path d=\"M{MARGIN} {at:.1}H{:.1}\" stroke=\"#ddd\"/><text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">1e{decade}</text>",
            WIDTH - MARGIN,
            MARGIN - 6.0,
            at + 4.0
        );
    }
    for (k, curve) in curves.iter().enumerate() {
        let colour = COLOURS[k % COLOURS.len()];
        let path: Vec<String> = curve
            .points
            .iter()
            .filter(usable)
            .map(|p| format!("{:.1},{:.1}", x(p.0), y(p.1.max(10f64.powf(y0)))))
            .collect();
        let dash = if curve.dashed { " stroke-dasharray=\"6 4\"" } else { "" };
        let line = MARGIN + 18.0 * k as f64 + 12.0;
        let _ = writeln!(
            svg,
            "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"1.6\"{dash}/>\n\
             <path d=\"M{} {line}h24\" stroke=\"{colour}\" stroke-width=\"2\"{dash}/><text x=\"{}\" y=\"{}\">{}</text>",
            path.join(" "),
            MARGIN + 10.0,
            MARGIN + 40.0,
            line + 4.0,
            escape(&curve.name)
        );
    }
    svg.push_str("</svg>\n");
    svg
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}
