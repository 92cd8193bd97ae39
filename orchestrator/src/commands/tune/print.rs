//! What `tune` prints.

use std::io::Write as _;

use synthesis::robot::{GainsFile, Spec};

use super::super::margins::{print_flown, print_margins, print_sampled};
use super::TuneArgs;

/// Prints the file as the user asked for it.
pub(super) fn print(args: &TuneArgs, spec: &Spec, file: &GainsFile, seconds: f64) -> anyhow::Result<()> {
    let mut out = crate::output::stdout();
    if args.json {
        writeln!(out, "{}", serde_json::to_string_pretty(file)?)?;
        return Ok(());
    }
    let p = &file.provenance;
    if args.table {
        let optimum = p.full_order.last().map_or("-".into(), |x| format!("{x:.3}"));
        let margins: Vec<String> = file
            .margins
            .iter()
            .map(|m| format!("{:.3}..{:.3}", m.guaranteed, m.destabilising))
            .collect();
        writeln!(
            out,
            "| {} | {:.4} | {:.4} | {optimum} | {} | {seconds:.1} |",
            spec.title,
            p.gamma,
            p.gamma_reported,
            margins.join(", ")
        )?;
        return Ok(());
    }
    writeln!(out, "{}\n", spec.title)?;
    writeln!(
        out,
        "gamma {:.5} (delays to order {}: {:.5}), tuned in {seconds:.1} s",
        p.gamma, spec.sampling.pade_order_reporting, p.gamma_reported
    )?;
    writeln!(
        out,
        "starts {}; certificate {:.1e} within {:.0e}",
        p.starts.join(" "),
        p.certificate,
        p.certificate_radius
    )?;
    if let [low, high] = p.full_order[..] {
        writeln!(
            out,
            "full-order optimum of the tracking channel, {}: between {low:.4} and {high:.4}",
            spec.models[0].name
        )?;
    }
    writeln!(
        out,
        "\n{:16} {:10} {:>9} {:>12}",
        "model", "channel", "norm", "peak rad/s"
    )?;
    for c in &file.channels {
        writeln!(
            out,
            "{:16} {:10} {:9.4} {:12.4}",
            c.model, c.channel, c.norm, c.omega_rad_s
        )?;
    }
    print_sampled(&mut out, &file.sampled)?;
    print_flown(&mut out, &file.flown)?;
    print_margins(&mut out, &file.margins)?;
    if let Some(v) = &file.validation {
        writeln!(
            out,
            "\nvalidation: {} situations, {} unstable, worst gamma {:.3}",
            v.samples, v.unstable, v.worst_gamma
        )?;
        for (edge, count) in &v.histogram {
            writeln!(out, "  from {edge:5.2} {count:4} {}", "#".repeat(*count))?;
        }
    }
    Ok(())
}
