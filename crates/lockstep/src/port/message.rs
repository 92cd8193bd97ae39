//! Typed payloads: a struct in C layout with its description.

use super::{Descriptor, Element, EnumValue, Field};

/// A payload: plain data, without padding, described field by field. Declared with [`crate::message!`].
///
/// All-zero bytes are a valid message. Other bytes need not be: a truth value is 0 or 1, and an enumeration allows only some values.
pub trait Message: bytemuck::NoUninit + bytemuck::Zeroable + bytemuck::CheckedBitPattern {
    /// The description of the type.
    fn descriptor() -> Descriptor;
}

/// A type that a field of a message may have: a number, a truth value, an enumeration ([`crate::enumeration!`]), a text ([`super::Text`]),
/// bytes ([`super::Bytes`]), or a (nested) array of one of them.
///
/// # Safety
/// `Bits` has the size and the alignment of the type, and the type has no uninitialised bytes; [`FieldType::is_valid`] is true only for
/// bits that are a value of the type, and is true for zeros.
pub unsafe trait FieldType: Copy + 'static {
    /// The bit patterns, not all of which need be a value.
    type Bits: bytemuck::Pod;
    /// The type of each element.
    const ELEMENT: Element;
    /// Appends the extents, outermost first.
    fn extents(shape: &mut Vec<u32>);
    /// The values of an enumeration.
    fn values() -> Vec<EnumValue> {
        Vec::new()
    }
    /// Whether the bits are a valid value.
    #[inline]
    fn is_valid(bits: &Self::Bits) -> bool {
        let _ = bits;
        true
    }
}

macro_rules! scalar {
    ($($type:ty => $element:ident),*) => {$(
        // SAFETY: every bit pattern is a number.
        unsafe impl FieldType for $type {
            type Bits = $type;
            const ELEMENT: Element = Element::$element;
            fn extents(_: &mut Vec<u32>) {}
        }
    )*};
}
scalar!(
    f64 => F64, f32 => F32, i64 => I64, i32 => I32, i16 => I16, i8 => I8, u64 => U64, u32 => U32, u16 => U16, u8 => U8
);

// SAFETY: a truth value is one byte, 0 or 1.
unsafe impl FieldType for bool {
    type Bits = u8;
    const ELEMENT: Element = Element::Bool;
    fn extents(_: &mut Vec<u32>) {}
    #[inline]
    fn is_valid(bits: &u8) -> bool {
        *bits <= 1
    }
}

// SAFETY: an array has no padding between its elements.
unsafe impl<T: FieldType, const N: usize> FieldType for [T; N]
where
    [T::Bits; N]: bytemuck::Pod,
{
    type Bits = [T::Bits; N];
    const ELEMENT: Element = T::ELEMENT;
    fn extents(shape: &mut Vec<u32>) {
        shape.push(N as u32);
        T::extents(shape);
    }
    fn values() -> Vec<EnumValue> {
        T::values()
    }
    #[inline]
    fn is_valid(bits: &Self::Bits) -> bool {
        bits.iter().all(T::is_valid)
    }
}

/// What the code that [`crate::message!`] writes calls.
#[doc(hidden)]
pub mod __private {
    use super::{Field, FieldType};

    pub use bytemuck;
    pub use serde;

    /// As bytes: exact, and of the same length for every value.
    pub fn serialize<M: super::Message, S: serde::Serializer>(message: &M, to: S) -> Result<S::Ok, S::Error> {
        to.serialize_bytes(bytemuck::bytes_of(message))
    }

    pub fn deserialize<'de, M: super::Message, D: serde::Deserializer<'de>>(from: D) -> Result<M, D::Error> {
        from.deserialize_byte_buf(Bytes(std::marker::PhantomData))
    }

    struct Bytes<M>(std::marker::PhantomData<fn() -> M>);

    impl<'de, M: super::Message> serde::de::Visitor<'de> for Bytes<M> {
        type Value = M;

        fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            write!(f, "the {} bytes of a message", size_of::<M>())
        }

        fn visit_bytes<E: serde::de::Error>(self, bytes: &[u8]) -> Result<M, E> {
            use bytemuck::checked::CheckedCastError::InvalidBitPattern;
            bytemuck::checked::try_pod_read_unaligned(bytes).map_err(|error| match error {
                InvalidBitPattern => {
                    E::custom("a bool, an enumeration or a text has bytes that are none of its values")
                }
                _ => E::invalid_length(bytes.len(), &self),
            })
        }

        fn visit_byte_buf<E: serde::de::Error>(self, bytes: Vec<u8>) -> Result<M, E> {
            self.visit_bytes(&bytes)
        }

        fn visit_seq<A: serde::de::SeqAccess<'de>>(self, mut seq: A) -> Result<M, A::Error> {
            let mut bytes = Vec::with_capacity(size_of::<M>());
            while bytes.len() < size_of::<M>() {
                let next = seq.next_element()?;
                bytes.push(next.ok_or_else(|| serde::de::Error::invalid_length(bytes.len(), &self))?);
            }
            self.visit_bytes(&bytes)
        }
    }

    pub fn field<T: FieldType>(name: &str, unit: &str, frame: &str, offset: usize) -> Field {
        let mut shape = Vec::new();
        T::extents(&mut shape);
        Field {
            name: name.to_owned(),
            element: T::ELEMENT,
            shape,
            unit: unit.to_owned(),
            frame: frame.to_owned(),
            offset: offset as u32,
            values: T::values(),
        }
    }
}

/// Declares a message: a `#[repr(C)]` struct of plain data whose fields carry a unit and, for vectors, a frame. Fields are numbers of 8
/// to 64 bits, `bool`, enumerations of one byte ([`enumeration!`](crate::enumeration)), texts and bytes in fixed room
/// ([`Text`](crate::port::Text), [`Bytes`](crate::port::Bytes)), and arrays of these. Fields that are not numbers have the unit `"1"`.
///
/// ```
/// lockstep::message! {
///     /// What the motor reports.
///     pub struct Motor {
///         /// Momentum stored, body axes.
///         pub momentum: [f64; 3] = "N m s" in "B",
///         /// Speed of the rotor.
///         pub speed: f64 = "rad/s",
///     }
/// }
/// use lockstep::port::Message;
/// assert_eq!(Motor::descriptor().fields[0].unit, "N m s");
/// ```
///
/// The message has the name of the struct. With `struct Motor as "MotorState"` descriptors and tapes have the latter, so that a type can be
/// renamed without a change of the digests.
///
/// A struct with padding does not compile: make the padding a field. Messages implement `serde::Serialize` and `serde::Deserialize` as
/// their bytes, so that they can be part of the state of a participant ([`crate::participant::state`]).
#[macro_export]
macro_rules! message {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident $(as $recorded:literal)? {
            $( $(#[$field_meta:meta])* $field_vis:vis $field:ident : $type:ty = $unit:literal $(in $frame:literal)? ),* $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        #[repr(C)]
        $vis struct $name {
            $( $(#[$field_meta])* $field_vis $field: $type, )*
        }

        const _: () = assert!(
            0 $( + ::core::mem::size_of::<$type>() )* == ::core::mem::size_of::<$name>(),
            "a message must not have padding: reorder its fields or make the padding a field"
        );

        const _: () = {
            /// The bits of the message.
            #[doc(hidden)]
            #[allow(non_snake_case, reason = "the names are those of the message")]
            #[derive(Clone, Copy)]
            #[repr(C)]
            pub struct Bits {
                $( $field: <$type as $crate::port::FieldType>::Bits, )*
            }

            // SAFETY: every field is plain old data.
            unsafe impl $crate::port::__private::bytemuck::Zeroable for Bits {}
            // SAFETY: as above, the layout is C, and the assertion above excludes padding: fields have the size of their bits.
            unsafe impl $crate::port::__private::bytemuck::Pod for Bits {}

            // SAFETY: every field is a `FieldType`, of which zeros are a value.
            unsafe impl $crate::port::__private::bytemuck::Zeroable for $name {}
            // SAFETY: as above; the layout is C without padding, and the struct is `Copy` and has no references.
            unsafe impl $crate::port::__private::bytemuck::NoUninit for $name {}
            // SAFETY: the bits have the layout of the message, and every field checks which of its own are a valid value.
            unsafe impl $crate::port::__private::bytemuck::CheckedBitPattern for $name {
                type Bits = Bits;
                #[inline]
                fn is_valid_bit_pattern(bits: &Bits) -> bool {
                    true $( && <$type as $crate::port::FieldType>::is_valid(&bits.$field) )*
                }
            }
        };

        impl $crate::port::Message for $name {
            fn descriptor() -> $crate::port::Descriptor {
                $crate::port::Descriptor {
                    name: [$($recorded,)? ::core::stringify!($name)][0].to_owned(),
                    size: ::core::mem::size_of::<$name>() as u32,
                    fields: ::std::vec![
                        $( $crate::port::__private::field::<$type>(
                            ::core::stringify!($field),
                            $unit,
                            ::core::concat!("" $(, $frame)?),
                            ::core::mem::offset_of!($name, $field),
                        ), )*
                    ],
                }
            }
        }

        impl $crate::port::__private::serde::Serialize for $name {
            fn serialize<S>(&self, to: S) -> ::core::result::Result<S::Ok, S::Error>
            where
                S: $crate::port::__private::serde::Serializer,
            {
                $crate::port::__private::serialize(self, to)
            }
        }

        impl<'de> $crate::port::__private::serde::Deserialize<'de> for $name {
            fn deserialize<D>(from: D) -> ::core::result::Result<Self, D::Error>
            where
                D: $crate::port::__private::serde::Deserializer<'de>,
            {
                $crate::port::__private::deserialize(from)
            }
        }

        impl ::core::default::Default for $name {
            fn default() -> Self {
                $crate::port::__private::bytemuck::Zeroable::zeroed()
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use crate::port::{Element, Message};

    crate::message! {
        struct Sample {
            position: [f64; 3] = "m" in "N",
            table: [[f32; 2]; 3] = "N m",
            count: u64 = "1",
        }
    }

    /// In a format with byte strings and in one that has only lists of numbers.
    #[test]
    fn message_round_trips_as_state() {
        let sample = Sample {
            position: [-0.0, f64::NAN, 1e-300],
            table: [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]],
            count: u64::MAX,
        };
        let bits = bytemuck::bytes_of(&sample);
        let saved = crate::participant::state::to_bytes(&(1_u8, sample)).unwrap();
        let (one, again): (u8, Sample) = crate::participant::state::from_bytes(&saved).unwrap();
        assert_eq!((one, bytemuck::bytes_of(&again)), (1, bits));
        assert!(crate::participant::state::from_bytes::<(u8, Sample)>(&saved[..saved.len() - 1]).is_err());

        let table = toml::Table::try_from(std::collections::BTreeMap::from([("sample", sample)])).unwrap();
        let again: std::collections::BTreeMap<String, Sample> = crate::units::read(&table).unwrap();
        assert_eq!(bytemuck::bytes_of(&again["sample"]), bits);
    }

    #[test]
    fn message_descriptor_matches_declaration() {
        let descriptor = Sample::descriptor();
        assert_eq!(descriptor.validate(), Ok(()));
        assert_eq!(descriptor.size, 56);
        let table = descriptor.field("table").unwrap();
        assert_eq!(
            (table.element, &table.shape[..], table.offset),
            (Element::F32, &[3, 2][..], 24)
        );
        assert_eq!(table.element_name(3), "table[1][1]");
        assert_eq!(descriptor.field("position").unwrap().frame, "N");
        let sample = Sample {
            position: [1.0, 2.0, 3.0],
            table: [[0.5; 2]; 3],
            count: 7,
        };
        let bytes = bytemuck::bytes_of(&sample);
        assert_eq!(descriptor.field("position").unwrap().value(bytes, 2), 3.0);
        assert_eq!(descriptor.field("table").unwrap().value(bytes, 5), 0.5);
        assert_eq!(descriptor.field("count").unwrap().value(bytes, 0), 7.0);
    }

    #[test]
    fn descriptor_with_other_unit_differs() {
        let descriptor = Sample::descriptor();
        let mut other = descriptor.clone();
        other.fields[0].unit = "cm".into();
        assert_ne!(descriptor.hash64(), other.hash64());
        let difference = descriptor.difference(&other).unwrap();
        assert!(
            difference.contains("in m") && difference.contains("in cm"),
            "{difference}"
        );
    }

    #[test]
    fn descriptor_validation_rejects_invalid_descriptors() {
        let good = Sample::descriptor();
        let spoil = |change: fn(&mut crate::port::Descriptor)| {
            let mut bad = good.clone();
            change(&mut bad);
            bad.validate().unwrap_err().to_string()
        };
        assert!(spoil(|d| d.size = 0).contains("0 bytes"));
        assert!(spoil(|d| d.size = 64).contains("padding"));
        assert!(spoil(|d| d.fields[1].offset = 4).contains("start where"));
        assert!(spoil(|d| d.fields[1].offset = 3).contains("multiple"));
        assert!(spoil(|d| d.fields[2].name = "table".into()).contains("twice"));
        assert!(spoil(|d| d.fields[0].shape = vec![u32::MAX, u32::MAX, u32::MAX]).contains("too large"));
        assert!(spoil(|d| d.fields[0].shape = vec![0]).contains("zero"));
        let error = spoil(|d| d.fields[1].name = "q\n".into());
        assert!(
            error.contains(r"field `q\u{a}`: its name `q\u{a}` has a control character"),
            "{error}"
        );
        let error = spoil(|d| d.fields[1].frame = "\u{1b}[2J".into());
        assert!(
            error.contains(r"its frame `\u{1b}[2J` has a control character"),
            "{error}"
        );
        for error in [
            spoil(|d| d.fields[1].unit = "N|m".into()),
            spoil(|d| d.name = "N|m".into()),
        ] {
            assert!(error.contains("`N|m` has `|` in it"), "{error}");
        }
        let error = spoil(|d| d.name = "A\u{202e}".into());
        assert!(error.contains(r"message `A\u{202e}`"), "{error}");
    }
}
