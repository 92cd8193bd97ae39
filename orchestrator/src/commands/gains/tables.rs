//! Tables of the margins and results of gains.

use std::io::Write;

use synthesis::robot::{ClosedLoopEntry, MarginEntry, SampledEntry, Spec, ValidationEntry};

/// The table of closed-loop simulations.
pub fn print_closed_loop(out: &mut impl Write, list: &[ClosedLoopEntry]) -> anyhow::Result<()> {
    if list.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "\n{:16} {:>13} {:>15} {:>9} {:>12}",
        "closed loop", "delays ms", "spectral radius", "settles", "saturated %"
    )?;
    for f in list {
        writeln!(
            out,
            "{:16} {:>13} {:15.8} {:>9} {:12.1}",
            f.model,
            format!("{0:.0} + {0:.0}", 1e3 * f.delay_s),
            f.spectral_radius,
            if f.settled { "yes" } else { "no" },
            100.0 * f.saturated_fraction
        )?;
    }
    Ok(())
}

/// The table of sampled loops.
pub fn print_sampled(out: &mut impl Write, list: &[SampledEntry]) -> anyhow::Result<()> {
    if list.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "\n{:16} {:>8} {:>15} {:>12} {:>14}",
        "sampled loop", "slosh", "spectral radius", "gain margin", "delay margin s"
    )?;
    for s in list {
        let slosh = if s.slosh { "free" } else { "frozen" };
        writeln!(
            out,
            "{:16} {slosh:>8} {:15.8} {:12.3} {:14.3}",
            s.model, s.spectral_radius, s.gain_margin, s.delay_margin_s
        )?;
    }
    Ok(())
}

/// The table of margins.
pub fn print_margins(out: &mut impl Write, list: &[MarginEntry]) -> anyhow::Result<()> {
    if list.is_empty() {
        return Ok(());
    }
    writeln!(
        out,
        "\nmargins, in multiples of the stated set: guaranteed, destabilising, critical rad/s"
    )?;
    for m in list {
        writeln!(
            out,
            "{:16} {:9.4} {:9.4} {:9.3}   {}",
            m.model, m.guaranteed, m.destabilising, m.critical_rad_s, m.set
        )?;
    }
    Ok(())
}

/// The histogram of the validation set.
pub fn print_validation(out: &mut impl Write, spec: &Spec, validation: Option<&ValidationEntry>) -> anyhow::Result<()> {
    let Some(v) = validation else { return Ok(()) };
    let limit = spec.validation.gamma;
    writeln!(
        out,
        "\nvalidation: {} situations, {} unstable, {} above {limit}, worst gamma {:.3}",
        v.samples, v.unstable, v.above, v.worst_gamma
    )?;
    for (edge, count) in &v.histogram {
        writeln!(out, "  from {edge:5.2} {count:4} {}", "#".repeat(*count))?;
    }
    Ok(())
}
