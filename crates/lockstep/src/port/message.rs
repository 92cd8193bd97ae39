//! Typed payloads: a struct in C layout with its description.

use super::{Descriptor, Element, Field};

/// A payload: plain old data, without padding, described field by field. Declared with [`crate::message!`].
pub trait Message: bytemuck::Pod {
    /// The description of the type.
    fn descriptor() -> Descriptor;
}

/// A type that a field of a message may have: a number, or a (nested) array of numbers.
pub trait FieldType: bytemuck::Pod {
    /// The type of each element.
    const ELEMENT: Element;
    /// Puts the extents, outermost first.
    fn extents(shape: &mut Vec<u32>);
}

macro_rules! scalar {
    ($($type:ty => $element:ident),*) => {$(
        impl FieldType for $type {
            const ELEMENT: Element = Element::$element;
            fn extents(_: &mut Vec<u32>) {}
        }
    )*};
}
scalar!(f64 => F64, f32 => F32, i64 => I64, i32 => I32, u64 => U64, u32 => U32, u8 => U8);

impl<T: FieldType, const N: usize> FieldType for [T; N]
where
    [T; N]: bytemuck::Pod,
{
    const ELEMENT: Element = T::ELEMENT;
    fn extents(shape: &mut Vec<u32>) {
        shape.push(N as u32);
        T::extents(shape);
    }
}

/// Builds one field of a descriptor; used by the [`crate::message!`] macro.
#[doc(hidden)]
pub mod __private {
    use super::{Field, FieldType};

    pub use bytemuck;

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
        }
    }
}

/// Declares a message: a `#[repr(C)]` struct of plain old data whose fields carry a unit and, for vectors, a frame.
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
/// A struct with padding does not compile: make the padding a field.
#[macro_export]
macro_rules! message {
    (
        $(#[$meta:meta])*
        $vis:vis struct $name:ident {
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

        // SAFETY: every field is `FieldType`, hence plain old data, the layout is C, and the assertion above excludes padding.
        unsafe impl $crate::port::__private::bytemuck::Zeroable for $name {}
        // SAFETY: as above; the struct is `Copy` and has no references, so `'static` holds too.
        unsafe impl $crate::port::__private::bytemuck::Pod for $name {}

        impl $crate::port::Message for $name {
            fn descriptor() -> $crate::port::Descriptor {
                $crate::port::Descriptor {
                    name: ::core::stringify!($name).to_owned(),
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

    #[test]
    fn a_message_describes_itself() {
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
    fn a_change_of_unit_is_another_type() {
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
    fn foreign_descriptors_are_not_trusted() {
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
    }
}
