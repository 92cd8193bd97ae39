//! Checks that value sources fit their keys.

use toml::Table;

use super::quantity::{Quantity, at_key};
use super::{AttitudeFormat, Dispersion, Mode, ValueSource};

/// Compares a dispersion with the values at its keys; `nominals` are the numbers there.
pub(super) fn check(
    dispersion: &Dispersion,
    nominals: &[Option<Quantity>],
    scenario: &Table,
    refuse: &mut dyn FnMut(&str, String),
) {
    let changes = dispersion.mode != Mode::Absolute || dispersion.source.transforms_value();
    if dispersion.targets.is_empty() && (changes || dispersion.source.transforms_value()) {
        refuse("key", "is missing: there is no value of the scenario to change".into());
    }
    let Some(numbers) = dispersion.source.number_count() else {
        if dispersion.mode != Mode::Absolute {
            refuse("as", "is for numbers, but the values are others".into());
        }
        if dispersion.step.is_some() {
            refuse("round", "is for numbers, but the values are others".into());
        }
        if dispersion.targets.iter().any(|target| target.element.is_some()) {
            refuse("key", "names an element, but the values are no numbers".into());
        }
        return;
    };
    for (target, nominal) in dispersion.targets.iter().zip(nominals) {
        let key = &target.key;
        let Some(nominal) = nominal else {
            if changes || target.element.is_some() {
                refuse(
                    "key",
                    match at_key(scenario, key) {
                        None => format!(
                            "the scenario does not say `{key}`: write a value there, or the whole value here with as = \"absolute\""
                        ),
                        Some(value) => format!("the scenario has {value} at `{key}`, which is no number"),
                    },
                );
            }
            continue;
        };
        let reason = match target.element {
            Some(_) if numbers != 1 => Some(format!("names an element, but the values have {numbers} numbers")),
            Some(element) if !nominal.is_list || element >= nominal.numbers.len() => Some(format!(
                "the scenario has {} at `{key}`: there is no element {element}, counted from 0",
                nominal.text()
            )),
            _ => shape_mismatch(dispersion, nominal, target.element.is_some(), numbers),
        };
        if let Some(reason) = reason {
            refuse("key", reason);
        }
        let named = dispersion.mode == Mode::Offset || target.element.is_some() || dispersion.source.transforms_value();
        let is_fraction = matches!(dispersion.mode, Mode::Relative | Mode::Factor)
            || matches!(dispersion.source, ValueSource::Inertia(_));
        if named && !is_fraction && dispersion.unit != nominal.unit {
            let (unit, nominal) = (&dispersion.unit, nominal.text());
            refuse(
                "unit",
                format!("is `{unit}`, but the scenario has {nominal} at `{key}`: use its unit"),
            );
        }
    }
}

/// The mistake of giving this many numbers to an existing value.
fn shape_mismatch(dispersion: &Dispersion, nominal: &Quantity, element: bool, numbers: usize) -> Option<String> {
    let there = || format!("the scenario has {} there", nominal.text());
    match &dispersion.source {
        ValueSource::Inertia(inertia) => {
            let fit = nominal.numbers.len() == 6 || (nominal.numbers.len() == 3 && inertia.rotation_deviation == 0.0);
            return (!fit).then(|| {
                format!(
                    "{}: an inertia has three principal moments, or with `turn` xx, yy, zz, xy, xz and yz",
                    there()
                )
            });
        }
        ValueSource::Misalignment(_, frame) => {
            let word = match frame {
                AttitudeFormat::Quaternion => "quaternion, the scalar first",
                AttitudeFormat::RollPitchYaw { .. } => "roll, pitch and yaw",
                AttitudeFormat::Direction => "direction of three numbers",
            };
            return (!nominal.is_list || nominal.numbers.len() != numbers)
                .then(|| format!("{}, which is no {word}: see `written`", there()));
        }
        _ => {}
    }
    let all = matches!(dispersion.mode, Mode::Relative | Mode::Factor) && numbers == 1;
    if element || all {
        return None;
    }
    if numbers == 1 && nominal.is_list {
        return Some(format!("{}: name one of the numbers, as in `KEY[0]`", there()));
    }
    if numbers > 1 && nominal.is_list && nominal.numbers.len() != numbers {
        return Some(format!("{}, but the values have {numbers} numbers", there()));
    }
    if numbers > 1 && !nominal.is_list {
        return Some(format!(
            "{}, which is one number, but the values have {numbers}",
            there()
        ));
    }
    let whole = nominal.decimals[..] == [Some(0)] && nominal.unit.is_empty();
    let rounded = dispersion.step.as_ref().is_some_and(|step| step.decimals == 0);
    let plain = dispersion.mode != Mode::Absolute || dispersion.unit.is_empty();
    (whole && plain && !rounded).then(|| format!("{}, a whole number: round to whole ones with round = 1", there()))
}
