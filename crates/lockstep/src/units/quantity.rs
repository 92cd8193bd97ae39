//! Fields of parameter structs that read quantities.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{Deserialize, Deserializer, Error, Visitor};

use super::{Dimension, UnitError, parse, unit_factor, unit_in};

/// A kind of quantity: its dimension, and the words for it in messages.
pub trait QuantityKind {
    /// Its dimension.
    const DIMENSION: Dimension;
    /// "a length".
    const WORDS: &'static str;
    /// "0.5 m".
    const EXAMPLE: &'static str;

    /// The value `si`, in SI units and radians, as a user would write it: in the unit of the example, for messages.
    fn text(si: f64) -> String {
        let unit = unit_in(Self::EXAMPLE).unwrap_or_default();
        let factor = unit_factor(unit).map_or(1.0, |(factor, _)| factor);
        // the conversion to SI units has rounded the number that was written
        let value = format!("{:.12e}", si / factor).parse().unwrap_or(si / factor);
        format!("{value} {unit}")
    }
}

/// One quantity: `"0.5 m"`.
pub struct Quantity<K>(f64, PhantomData<K>);

/// `N` components in one unit: `"[-0.42, 0, -2.85] m"`.
pub struct Vector<K, const N: usize>([f64; N], PhantomData<K>);

/// A quantity for each of `N` channels: `"[1, 2, 3] N"`, or `"9 N"` if all are the same.
pub struct PerAxis<K, const N: usize>([f64; N], PhantomData<K>);

impl<K> Quantity<K> {
    /// Creates it from a value in SI units and radians.
    pub const fn of(si: f64) -> Self {
        Self(si, PhantomData)
    }

    /// The value in SI units and radians.
    pub const fn si(&self) -> f64 {
        self.0
    }
}

macro_rules! components {
    ($($name:ident),*) => {$(
        impl<K, const N: usize> $name<K, N> {
            /// Creates it from values in SI units and radians.
            pub const fn of(si: [f64; N]) -> Self {
                Self(si, PhantomData)
            }

            /// The values in SI units and radians.
            pub const fn si(&self) -> [f64; N] {
                self.0
            }
        }

        impl<K, const N: usize> Clone for $name<K, N> {
            fn clone(&self) -> Self {
                *self
            }
        }

        impl<K, const N: usize> Copy for $name<K, N> {}

        impl<K, const N: usize> PartialEq for $name<K, N> {
            fn eq(&self, other: &Self) -> bool {
                self.0 == other.0
            }
        }

        impl<K, const N: usize> fmt::Debug for $name<K, N> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                self.0.fmt(f)
            }
        }
    )*};
}
components!(Vector, PerAxis);

impl<K> Clone for Quantity<K> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<K> Copy for Quantity<K> {}

impl<K> PartialEq for Quantity<K> {
    fn eq(&self, other: &Self) -> bool {
        self.0 == other.0
    }
}

impl<K> fmt::Debug for Quantity<K> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(f)
    }
}

/// Reads text as up to `N` numbers; returns how many there were and whether they were in brackets.
struct Text<K, const N: usize>(PhantomData<K>);

struct Read<const N: usize> {
    values: [f64; N],
    count: usize,
    listed: bool,
    text: String,
}

impl<K: QuantityKind, const N: usize> Visitor<'_> for Text<K, N> {
    type Value = Read<N>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} as text with a unit, for example \"{}\"", K::WORDS, K::EXAMPLE)
    }

    fn visit_str<E: Error>(self, text: &str) -> Result<Read<N>, E> {
        let mut values = [0.0; N];
        let (count, listed) = parse(text, K::DIMENSION, K::WORDS, K::EXAMPLE, |index, value| {
            if let Some(slot) = values.get_mut(index) {
                *slot = value;
            }
        })
        .map_err(E::custom)?;
        Ok(Read {
            values,
            count,
            listed,
            text: text.to_owned(),
        })
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<Read<N>, E> {
        Err(E::custom(bare::<K>(value)))
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<Read<N>, E> {
        Err(E::custom(bare::<K>(value)))
    }
}

fn bare<K: QuantityKind>(value: impl ToString) -> UnitError {
    UnitError::NoUnit {
        text: value.to_string(),
        words: K::WORDS,
        example: K::EXAMPLE,
    }
}

/// "0.5 m" as "[0.5, 0.5, 0.5] m".
fn list_example<K: QuantityKind, const N: usize>() -> String {
    let (number, unit) = K::EXAMPLE.split_once(' ').unwrap_or((K::EXAMPLE, ""));
    format!("[{}] {unit}", vec![number; N].join(", "))
}

fn wrong_count<K: QuantityKind, const N: usize, E: Error>(read: &Read<N>) -> E {
    let number = |count| {
        if count == 1 {
            "1 number".to_owned()
        } else {
            format!("{count} numbers")
        }
    };
    E::custom(UnitError::Count {
        text: read.text.clone(),
        found: match (read.listed, read.count) {
            (false, _) => "no brackets".to_owned(),
            (true, count) => number(count),
        },
        needed: match N {
            1 => "one number without brackets is".to_owned(),
            _ => format!("{N} in brackets are"),
        },
        example: match N {
            1 => K::EXAMPLE.to_owned(),
            _ => list_example::<K, N>(),
        },
    })
}

impl<'de, K: QuantityKind> Deserialize<'de> for Quantity<K> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let read = deserializer.deserialize_any(Text::<K, 1>(PhantomData))?;
        match read.listed {
            false => Ok(Self::of(read.values[0])),
            true => Err(wrong_count::<K, 1, _>(&read)),
        }
    }
}

impl<'de, K: QuantityKind, const N: usize> Deserialize<'de> for Vector<K, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let read = deserializer.deserialize_any(Text::<K, N>(PhantomData))?;
        match (read.listed, read.count == N) {
            (true, true) => Ok(Self::of(read.values)),
            _ => Err(wrong_count::<K, N, _>(&read)),
        }
    }
}

impl<'de, K: QuantityKind, const N: usize> Deserialize<'de> for PerAxis<K, N> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let read = deserializer.deserialize_any(Text::<K, N>(PhantomData))?;
        match (read.listed, read.count == N) {
            (true, true) => Ok(Self::of(read.values)),
            (false, _) => Ok(Self::of([read.values[0]; N])),
            _ => Err(wrong_count::<K, N, _>(&read)),
        }
    }
}
