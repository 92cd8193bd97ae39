//! K_S, the gain whose norm bounds the conditional integrator: the K_P of a file of proportional gains.

use std::path::Path;

use anyhow::{Context, bail};
use synthesis::robot::{GainTable, GainsFile, Spec};

use capture::closed_loop::find_beside_specification;
use capture::provenance::plant_digest;

/// The gains that `gains.ks` of the specification names; `None` when it does not name any.
///
/// # Errors
/// A file that is missing, is not a file of gains, or has gains that cannot be K_S of this robot.
pub fn sliding_gain(specification: &Path, spec: &Spec, urdf: &str) -> anyhow::Result<Option<GainTable>> {
    let Some(named) = &spec.gains.ks else {
        return Ok(None);
    };
    let key = || format!("gains.ks = {named:?}");
    let Some(found) = find_beside_specification(specification, named) else {
        bail!("{}: no such file here, beside the specification, or above it", key());
    };
    let text = std::fs::read_to_string(&found).with_context(key)?;
    let file: GainsFile = toml::from_str(&text).with_context(key)?;
    if Some(&file.provenance.plant_digest) != plant_digest(urdf).as_ref() {
        bail!(
            "{}: these gains were tuned for another robot; tune them again with `escapement tune {}`",
            key(),
            file.provenance.specification
        );
    }
    GainTable::clone(&file.gains)
        .take_sliding_gain(&file.gains)
        .map_err(|reason| anyhow::anyhow!("{}: these gains {reason}", key()))?;
    Ok(Some(file.gains))
}

/// Adds K_S to the tuned gains; returns whether that changed the previous value.
pub fn take_sliding_gain(file: &mut GainsFile, spec: &Spec, proportional: &GainTable) -> bool {
    let before = (file.gains.ks.clone(), file.gains.ks_matrix.clone());
    // It was validated when the file was read.
    let _ = file.gains.take_sliding_gain(proportional);
    file.provenance.ks.clone_from(&spec.gains.ks);
    before != (file.gains.ks.clone(), file.gains.ks_matrix.clone())
}
