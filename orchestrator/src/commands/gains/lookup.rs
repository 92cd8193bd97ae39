//! Situations at an instant of a run: `at = "RUN:TIME"` of a specification, `--at` of the command line.

use std::path::Path;

use anyhow::{Context, bail};
use lockstep::time::Rational;
use synthesis::robot::{ModelSpec, Spec};
use tape::folder::RunFolder;
use tape::{Reader, Source, split_record};

use crate::catalogue::catalogue;
use capture::closed_loop::{find_beside_specification, record_run};

/// The field of the plant's truth with the joint angles.
const JOINTS: &str = "q";
/// Resolution of the angles, 1/deg: the same specification gives the same problem although the last digits of a run change
/// with the plant.
const DIGITS: f64 = 100.0;

/// Applies `--at` of the command line to the specification: `RUN:TIME` for the only model, or `MODEL=RUN:TIME`.
///
/// # Errors
/// Names a model that does not exist.
pub fn override_with(spec: &mut Spec, places: &[String]) -> anyhow::Result<()> {
    for place in places {
        let names: Vec<String> = spec.models.iter().map(|model| model.name.clone()).collect();
        let (name, at) = match place.split_once('=') {
            Some((name, at)) => (name, at),
            None if names.len() == 1 => (names[0].as_str(), place.as_str()),
            None => bail!(
                "--at {place}: the specification has {} models; write MODEL=RUN:TIME, with one of: {}",
                names.len(),
                names.join(", ")
            ),
        };
        let Some(model) = spec.models.iter_mut().find(|model| model.name == name) else {
            bail!(
                "--at {place}: there is no model {name:?}; there are {}",
                names.join(", ")
            );
        };
        model.joints_deg.clear();
        model.at = Some(at.to_owned());
    }
    Ok(())
}

/// Looks up every situation that has `at` instead of joint angles.
///
/// # Errors
/// A situation with both or neither, a run that is missing or too short.
pub fn look_up(specification: &Path, spec: &mut Spec) -> anyhow::Result<()> {
    spec.models
        .iter_mut()
        .try_for_each(|model| look_up_one(specification, model))
}

fn look_up_one(specification: &Path, model: &mut ModelSpec) -> anyhow::Result<()> {
    let key = format!("models: {:?}", model.name);
    match (&model.at, model.joints_deg.is_empty()) {
        (None, false) => {}
        (None, true) => bail!("{key}: has no configuration; give joints_deg, or at = \"RUN:TIME\""),
        (Some(at), false) => bail!("{key}: joints_deg and at = {at:?} are both given; leave one of them out"),
        (Some(at), true) => {
            model.joints_deg = joints_at(specification, at).with_context(|| format!("{key}: at = {at:?}"))?;
        }
    }
    Ok(())
}

/// Uses the angles that a file of gains has from its tuning, and looks up the others. Reports differences from the present
/// runs.
///
/// # Errors
/// As [`look_up`].
pub fn restore_recorded_angles(specification: &Path, spec: &mut Spec, recorded: &[ModelSpec]) -> anyhow::Result<()> {
    for model in &mut spec.models {
        let same = |then: &&ModelSpec| then.name == model.name && then.at == model.at;
        let (Some(at), Some(then)) = (&model.at, recorded.iter().find(same)) else {
            look_up_one(specification, model)?;
            continue;
        };
        match joints_at(specification, at) {
            Ok(now) if now == then.joints_deg => {}
            Ok(now) => eprintln!(
                "note: {}: at {at} the joints are now at {now:?} deg, and these gains were tuned for {:?}",
                model.name, then.joints_deg
            ),
            Err(error) => eprintln!("note: {}: {at} cannot be looked up again: {error:#}", model.name),
        }
        model.joints_deg.clone_from(&then.joints_deg);
    }
    Ok(())
}

/// The joint angles, deg, of the recorded run or the scenario, at the instant.
fn joints_at(specification: &Path, at: &str) -> anyhow::Result<Vec<f64>> {
    let (run, time) = at
        .rsplit_once(':')
        .context("no instant; write RUN:TIME, for example runs/close-1:30s")?;
    let instant: Rational = time
        .trim()
        .parse()
        .map_err(|error| anyhow::anyhow!("{time:?} is no time ({error}); write for example 30s"))?;
    if instant.is_negative() {
        bail!("{time} is before the start; write a time from zero on");
    }
    let Some(found) = find_beside_specification(specification, run) else {
        bail!("{run:?}: no such run folder or scenario here, beside the specification, or above it");
    };
    if found.is_dir() {
        return read(&RunFolder::open(&found).tape(), instant.seconds());
    }
    record_run(catalogue(), &found, instant, |run| {
        read(&RunFolder::open(run).tape(), instant.seconds())
    })
}

/// The joint angles of the sample at this instant, deg.
fn read(tape: &Path, instant_s: f64) -> anyhow::Result<Vec<f64>> {
    let reader = Reader::open(tape)?;
    let streams = reader.streams();
    let truths: Vec<usize> = (0..streams.len())
        .filter(|&stream| streams[stream].descriptor.name == "Truth")
        .collect();
    let &[stream] = truths.as_slice() else {
        bail!(
            "{}: {} streams have the message `Truth`, and one is needed to read the joints from",
            tape.display(),
            truths.len()
        );
    };
    let spec = &streams[stream];
    let field = spec
        .descriptor
        .field(JOINTS)
        .with_context(|| format!("{}: no field `{JOINTS}`", spec.name()))?;
    let (from, count) = (field.offset as usize, field.shape.iter().product::<u32>() as usize);
    let mut record = vec![0; spec.stride()];
    let mut stamp = |index: u64| -> anyhow::Result<f64> {
        reader.read(stream, index, &mut record)?;
        Ok(split_record(&record, index).stamp_s)
    };
    // The last sample at or before the instant.
    let (mut low, mut high) = (0, reader.count(stream));
    while high - low > 1 {
        let middle = low + (high - low) / 2;
        if stamp(middle)? <= instant_s * (1.0 + 1e-12) {
            low = middle;
        } else {
            high = middle;
        }
    }
    if reader.count(stream) == 0 {
        bail!("{}: {} has no sample", tape.display(), spec.name());
    }
    let (own, period) = (stamp(low)?, spec.period.seconds());
    if instant_s - own > 1.5 * period {
        bail!(
            "{}: {} ends at {own} s, before {instant_s} s",
            tape.display(),
            spec.name()
        );
    }
    let payload = split_record(&record, low).payload;
    let value = |index: usize| {
        let at = from + index * size_of::<f64>();
        let bytes = payload
            .get(at..at + size_of::<f64>())
            .and_then(|bytes| bytes.try_into().ok());
        bytes.map_or(f64::NAN, f64::from_le_bytes)
    };
    Ok((0..count)
        .map(|index| (DIGITS * value(index).to_degrees()).round() / DIGITS)
        .collect())
}
