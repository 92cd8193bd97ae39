//! The page: one self-contained HTML file.

use serde_json::{Value, json};

use super::run::{Run, merge_figures};
use super::series::Series;
use super::summary::{Row, outcome};
use crate::markup::escape;
use crate::scene::Motion;

const TEMPLATE: &str = include_str!("assets/page.html");
/// The style of pages.
pub(crate) const STYLE: &str = include_str!("assets/style.css");
/// Utility functions of every page.
pub(crate) const TOOLS: &str = include_str!("assets/base.js");
/// Round numbers for axes, and panels over time.
pub(crate) const TICKS: &str = include_str!("assets/chart.js");
const SCRIPTS: [&str; 9] = [
    TOOLS,
    include_str!("assets/pens.js"),
    TICKS,
    include_str!("assets/figure.js"),
    include_str!("assets/gl.js"),
    include_str!("assets/scene.js"),
    include_str!("assets/player.js"),
    include_str!("assets/live.js"),
    include_str!("assets/main.js"),
];

/// The data of the page, in its encoding.
pub(crate) fn data(title: &str, runs: &[Run], rows: &[Row]) -> Value {
    json!({
        "title": title,
        "figures": merge_figures(runs),
        "runs": runs.iter().map(run).collect::<Vec<_>>(),
        "summary": rows,
    })
}

/// Assembles the page. The `{{…}}` in the template are the only places that are filled in. A `live` page may request
/// updates from the server that it came from; any other page may connect to nothing.
pub(crate) fn render(title: &str, data: &Value, live: bool) -> String {
    // Inside a script element only `</` and `<!` could end or disturb it; `<` never needs to be literal in JSON.
    let data = data.to_string().replace('<', "\\u003c");
    let connect = if live { "; connect-src 'self'" } else { "" };
    fill_template(
        &TEMPLATE.replace("{{connect}}", connect),
        title,
        &[STYLE],
        &data,
        &SCRIPTS,
    )
}

/// A template with its placeholders filled in: `data` is JSON without `<`.
pub(crate) fn fill_template(template: &str, title: &str, styles: &[&str], data: &str, scripts: &[&str]) -> String {
    let mut page = String::with_capacity(data.len() + 200_000);
    let mut rest = template;
    while let Some((before, after)) = rest.split_once("{{") {
        page += before;
        let (name, after) = after.split_once("}}").unwrap_or((after, ""));
        match name {
            "title" => page += &escape(title),
            "style" => styles.iter().for_each(|style| page += style),
            "data" => page += data,
            "scripts" => scripts.iter().for_each(|script| page += script),
            _ => unreachable!("a template has no other places"),
        }
        rest = after;
    }
    page + rest
}

fn run(run: &Run) -> Value {
    let outcome = outcome(&run.summary);
    let figures = run.figures.iter();
    let figures = figures.map(|figure| (figure.drawn.id.clone(), series_list(&figure.series)));
    let differing = run.figures.iter().filter(|figure| !figure.differences.is_empty());
    let differences = differing.map(|figure| (figure.drawn.id.clone(), series_list(&figure.differences)));
    json!({
        "name": run.name,
        "digest": run.digest,
        "sealed": run.sealed,
        "notes": run.notes,
        "plan": run.plan.text,
        "events": run.events,
        "figures": figures.collect::<serde_json::Map<_, _>>(),
        "differences": differences.collect::<serde_json::Map<_, _>>(),
        "marks": run.marks,
        "scene": run.scene.as_ref().map(|(scene, _)| scene),
        "motion": run.scene.as_ref().map(|(_, over_time)| motion(over_time)),
        "participants": run.participants,
        "outcome": outcome.as_ref().map(|(text, _)| text),
        "met": outcome.as_ref().map(|(_, good)| good),
        "title": run.about["title"],
        "started": run.about["started"],
    })
}

fn series_list(list: &[Series]) -> Value {
    list.iter().map(series).collect()
}

fn series(series: &Series) -> Value {
    let index = series.index.as_ref();
    json!({
        "label": series.label,
        "origin": series.origin,
        "step": series.step,
        "t0": series.offset_s,
        "dt": series.period_s,
        "first": series.first_index,
        "samples": series.samples,
        "index": index.map(|kept| base64(kept.iter().flat_map(|k| k.to_le_bytes()))),
        "x": series.x.as_ref().map(|x| base64(x.iter().flat_map(|x| x.to_le_bytes()))),
        "y": base64(series.y.iter().flat_map(|y| y.to_le_bytes())),
    })
}

pub(crate) fn motion(motion: &Motion) -> Value {
    let channels = motion.values.iter().map(|channel| {
        let numbers = base64(channel.numbers.iter().flat_map(|x| x.to_le_bytes()));
        json!({ "attitude": channel.attitude, "width": channel.width, "values": numbers })
    });
    json!({
        "t": base64(motion.t.iter().flat_map(|t| t.to_le_bytes())),
        "channels": channels.collect::<Vec<_>>(),
    })
}

/// Base 64 of bytes (RFC 4648): arrays of numbers as text that the browser decodes at once.
pub(crate) fn base64(bytes: impl Iterator<Item = u8>) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut out = String::new();
    let mut group = [0_u8; 3];
    let mut filled = 0;
    let mut put = |group: [u8; 3], filled: usize| {
        let bits = u32::from_be_bytes([0, group[0], group[1], group[2]]);
        for digit in 0..4 {
            if digit <= filled {
                out.push(char::from(DIGITS[(bits >> (18 - 6 * digit) & 63) as usize]));
            } else {
                out.push('=');
            }
        }
    };
    for byte in bytes {
        group[filled] = byte;
        filled += 1;
        if filled == 3 {
            put(group, 3);
            (group, filled) = ([0; 3], 0);
        }
    }
    if filled > 0 {
        put(group, filled);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_matches_rfc_4648() {
        for (text, expected) in [
            ("", ""),
            ("f", "Zg=="),
            ("fo", "Zm8="),
            ("foo", "Zm9v"),
            ("foob", "Zm9vYg=="),
            ("fooba", "Zm9vYmE="),
            ("foobar", "Zm9vYmFy"),
        ] {
            assert_eq!(base64(text.bytes()), expected);
        }
    }
}
