//! Checks that draws fit their keys.

use toml::Table;

use super::quantity::{Quantity, at_key};
use super::{Dispersion, Draws, Frame, Mode};

/// Compares a dispersion with the values at its keys; `owns` are the numbers there.
pub(super) fn check(
    dispersion: &Dispersion,
    owns: &[Option<Quantity>],
    scenario: &Table,
    refuse: &mut dyn FnMut(&str, String),
) {
    let changes = dispersion.mode != Mode::Absolute || dispersion.draws.turns();
    if dispersion.targets.is_empty() && (changes || dispersion.draws.turns()) {
        refuse("key", "is missing: there is no value of the scenario to change".into());
    }
    let Some(numbers) = dispersion.draws.numbers() else {
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
    for (target, own) in dispersion.targets.iter().zip(owns) {
        let key = &target.key;
        let Some(own) = own else {
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
            Some(element) if !own.listed || element >= own.numbers.len() => Some(format!(
                "the scenario has {} at `{key}`: there is no element {element}, counted from 0",
                own.text()
            )),
            _ => shapes(dispersion, own, target.element.is_some(), numbers),
        };
        if let Some(reason) = reason {
            refuse("key", reason);
        }
        let named = dispersion.mode == Mode::Offset || target.element.is_some() || dispersion.draws.turns();
        let parts =
            matches!(dispersion.mode, Mode::Relative | Mode::Factor) || matches!(dispersion.draws, Draws::Inertia(_));
        if named && !parts && dispersion.unit != own.unit {
            let (unit, own) = (&dispersion.unit, own.text());
            refuse(
                "unit",
                format!("is `{unit}`, but the scenario has {own} at `{key}`: use its unit"),
            );
        }
    }
}

/// The mistake of giving this many numbers to an existing value.
fn shapes(dispersion: &Dispersion, own: &Quantity, element: bool, numbers: usize) -> Option<String> {
    let there = || format!("the scenario has {} there", own.text());
    match &dispersion.draws {
        Draws::Inertia(inertia) => {
            let fit = own.numbers.len() == 6 || (own.numbers.len() == 3 && inertia.turn == 0.0);
            return (!fit).then(|| {
                format!(
                    "{}: an inertia has three principal moments, or with `turn` xx, yy, zz, xy, xz and yz",
                    there()
                )
            });
        }
        Draws::Misalignment(_, frame) => {
            let word = match frame {
                Frame::Quaternion => "quaternion, the scalar first",
                Frame::RollPitchYaw { .. } => "roll, pitch and yaw",
                Frame::Direction => "direction of three numbers",
            };
            return (!own.listed || own.numbers.len() != numbers)
                .then(|| format!("{}, which is no {word}: see `written`", there()));
        }
        _ => {}
    }
    let all = matches!(dispersion.mode, Mode::Relative | Mode::Factor) && numbers == 1;
    if element || all {
        return None;
    }
    if numbers == 1 && own.listed {
        return Some(format!("{}: name one of the numbers, as in `KEY[0]`", there()));
    }
    if numbers > 1 && own.listed && own.numbers.len() != numbers {
        return Some(format!("{}, but the values have {numbers} numbers", there()));
    }
    if numbers > 1 && !own.listed {
        return Some(format!(
            "{}, which is one number, but the values have {numbers}",
            there()
        ));
    }
    let whole = own.decimals[..] == [Some(0)] && own.unit.is_empty();
    let rounded = dispersion.step.as_ref().is_some_and(|step| step.decimals == 0);
    let plain = dispersion.mode != Mode::Absolute || dispersion.unit.is_empty();
    (whole && plain && !rounded).then(|| format!("{}, a whole number: round to whole ones with round = 1", there()))
}
