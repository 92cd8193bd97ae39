//! The items of an FMU's enumeration as the values of a field, one byte each.

use std::collections::BTreeSet;

use lockstep::port::EnumValue;

use crate::description::{Type, Variable};

/// The name of 0, which a field needs, where the FMU has no item for it.
const NONE: &str = "none";

/// The values of a field, and the corresponding values of the FMU.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Items {
    /// The field's values; empty where the variable is a number.
    pub values: Vec<EnumValue>,
    /// The FMU's values, in the same order.
    own: Vec<i64>,
}

impl Items {
    /// The values of a variable. The byte is the item's value where all items fit into one byte; a 0 without item is called
    /// [`NONE`]. Otherwise the byte is the item's index in the list, from 0. An enumeration without items, or with more
    /// than a byte holds, is a number.
    pub fn of(variable: &Variable) -> Items {
        let items = &variable.items;
        if variable.kind != Type::Enumeration || items.is_empty() || items.len() > 256 {
            return Items::default();
        }
        let direct = items.iter().all(|item| u8::try_from(item.value).is_ok());
        let odd = |letter: char| letter.is_control() || EnumValue::SEPARATORS.contains(&letter);
        let value = |(place, item): (usize, &crate::description::Item)| {
            let byte = if direct { item.value as u8 } else { place as u8 };
            EnumValue::new(item.name.replace(odd, "_"), byte)
        };
        let mut values: Vec<EnumValue> = items.iter().enumerate().map(value).collect();
        if values.iter().all(|one| one.value != 0) {
            // Appended after the items, so that the FMU's values keep their indices.
            values.push(EnumValue::new(NONE, 0));
        }
        let own: Vec<i64> = items.iter().map(|item| item.value).collect();
        let names: BTreeSet<&str> = values.iter().map(|one| one.name.trim()).collect();
        let numbers: BTreeSet<&i64> = own.iter().collect();
        if names.len() < values.len() || numbers.len() < items.len() || names.contains("") {
            return Items::default();
        }
        Items { values, own }
    }

    /// The FMU's value of the byte.
    pub fn own(&self, byte: u8) -> Option<i64> {
        let place = self.values.iter().position(|one| one.value == byte)?;
        self.own.get(place).copied()
    }

    /// The byte of the FMU's value.
    pub fn byte(&self, own: i64) -> Option<u8> {
        let place = self.own.iter().position(|one| *one == own)?;
        self.values.get(place).map(|one| one.value)
    }
}
