//! Output of `tune`.

use std::io::Write;

use synthesis::robot::{GainsFile, Spec};

use super::arguments::TuneArgs;
use crate::commands::gains::{json, print_closed_loop, print_margins, print_sampled, print_validation};

/// Prints the file in the requested form.
pub(super) fn print(args: &TuneArgs, spec: &Spec, file: &GainsFile, seconds: f64) -> anyhow::Result<()> {
    let mut out = crate::output::stdout();
    if args.json {
        writeln!(out, "{}", json(file)?)?;
        return Ok(());
    }
    let p = &file.provenance;
    if args.table {
        let hardest = file.full_order.iter().map(|o| o.reachable).fold(0.0, f64::max);
        let margins: Vec<String> = file
            .margins
            .iter()
            .map(|m| format!("{:.3}..{:.3}", m.guaranteed, m.destabilising))
            .collect();
        writeln!(
            out,
            "| {} | {:.4} | {:.4} | {hardest:.3} | {} | {seconds:.1} |",
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
        "starts {}; certificate {:.1e} (steepest gradient {:.1e}) within {:.0e}",
        p.starts.join(" "),
        p.certificate,
        p.certificate_steepest,
        p.certificate_radius
    )?;
    for o in &file.full_order {
        writeln!(
            out,
            "full-order optimum of the tracking channel, {}: between {:.4} and {:.4}",
            o.model, o.unreachable, o.reachable
        )?;
    }
    if !file.rounds.is_empty() {
        writeln!(
            out,
            "\n{:>9} {:>9}   validation: {:>8} {:>6} {:>12}",
            "models", "gamma", "unstable", "above", "worst gamma"
        )?;
        for r in &file.rounds {
            writeln!(
                out,
                "{:9} {:9.4} {:>22} {:6} {:12.3}",
                r.models, r.gamma, r.unstable, r.above, r.worst_gamma
            )?;
        }
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
    print_closed_loop(&mut out, &file.closed_loop)?;
    print_margins(&mut out, &file.margins)?;
    print_validation(&mut out, spec, file.validation.as_ref())
}
