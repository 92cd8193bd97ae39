//! The declaration of an enumeration type for the fields of messages.

/// Declares an enumeration that a field of a message may have: one byte with named values, one of which is 0.
///
/// ```
/// lockstep::enumeration! {
///     /// What the valve does.
///     pub enum Valve {
///         /// Nothing flows.
///         Closed = 0,
///         /// On its way.
///         Opening = 1,
///         /// All flows.
///         Open = 2,
///     }
/// }
/// lockstep::message! {
///     /// What the tank reports.
///     pub struct Tank {
///         /// Its valve.
///         pub valve: Valve = "1",
///         /// Whether it is empty.
///         pub empty: bool = "1",
///     }
/// }
/// use lockstep::port::Message;
/// assert_eq!(Tank::default().valve, Valve::Closed);
/// assert_eq!(Tank::descriptor().fields[0].values[2].name, "Open");
/// ```
///
/// The names in files and on pages are those of the variants; with `Closed as "Shut" = 0` they have the latter. An enumeration without 0 does not compile: an input is all zero bytes
/// before its first sample.
#[macro_export]
macro_rules! enumeration {
    (
        $(#[$meta:meta])*
        $vis:vis enum $name:ident {
            $( $(#[$value_meta:meta])* $value:ident $(as $recorded:literal)? = $byte:literal ),+ $(,)?
        }
    ) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[repr(u8)]
        $vis enum $name {
            $( $(#[$value_meta])* $value = $byte, )+
        }

        const _: () = assert!(
            false $( || $byte == 0 )+,
            "an enumeration needs a value 0, which an input shows before its first sample"
        );

        impl ::core::default::Default for $name {
            fn default() -> Self {
                const ALL: &[$name] = &[$( $name::$value ),+];
                const fn zero() -> $name {
                    let mut at = 0;
                    while ALL[at] as u8 != 0 {
                        at += 1;
                    }
                    ALL[at]
                }
                const { zero() }
            }
        }

        // SAFETY: one byte; the values are those of the variants, and 0 is one of them, as asserted above.
        unsafe impl $crate::port::FieldType for $name {
            type Bits = u8;
            const ELEMENT: $crate::port::Element = $crate::port::Element::Enum;
            fn extents(_: &mut ::std::vec::Vec<u32>) {}
            fn values() -> ::std::vec::Vec<$crate::port::EnumValue> {
                ::std::vec![$( $crate::port::EnumValue::new([$($recorded,)? ::core::stringify!($value)][0], $byte) ),+]
            }
            #[inline]
            fn is_valid(bits: &u8) -> bool {
                false $( || *bits == $byte )+
            }
        }
    };
}

#[cfg(test)]
mod tests {
    use crate::participant::Payload;
    use crate::port::{Descriptor, EnumValue, Message};

    crate::enumeration! {
        enum Mode {
            Wait = 0,
            Approach = 3,
            Hold = 200,
        }
    }

    crate::message! {
        struct Report {
            count: i16 = "1",
            level: u16 = "m",
            trim: [i8; 2] = "deg",
            modes: [Mode; 2] = "1",
            armed: [[bool; 2]; 1] = "1",
        }
    }

    fn report() -> Report {
        Report {
            count: -3,
            level: 65_535,
            trim: [-128, 127],
            modes: [Mode::Approach, Mode::Hold],
            armed: [[true, false]],
        }
    }

    #[test]
    fn descriptor_lists_enum_values_and_small_integers() {
        let descriptor = Report::descriptor();
        assert_eq!(descriptor.validate(), Ok(()));
        let names: Vec<&str> = descriptor.fields.iter().map(|field| field.element.name()).collect();
        assert_eq!(names, ["i16", "u16", "i8", "enum", "bool"]);
        let modes = descriptor.field("modes").unwrap();
        assert_eq!(
            modes.to_string(),
            "modes: enum[2] of Wait (0), Approach (3), Hold (200)"
        );
        assert_eq!(modes.name_of(3.0), Some("Approach"));
        assert!(
            descriptor
                .canonical()
                .contains("modes|enum|2|1||6|0=Wait,3=Approach,200=Hold\n")
        );
        let payload = Payload::of(&report());
        let value = |name: &str, index| descriptor.field(name).unwrap().value(payload.bytes(), index);
        assert_eq!(
            (value("count", 0), value("level", 0), value("trim", 0)),
            (-3.0, 65_535.0, -128.0)
        );
        assert_eq!(
            (value("modes", 1), value("armed", 0), value("armed", 1)),
            (200.0, 1.0, 0.0)
        );
        assert_eq!(payload.get::<Report>(), report());
        assert_eq!(Report::default().modes[0], Mode::Wait);
    }

    #[test]
    fn value_check_names_invalid_byte() {
        let descriptor = Report::descriptor();
        let spoilt = |offset: usize, byte: u8| {
            let mut payload = Payload::of(&report());
            payload.bytes_mut()[offset] = byte;
            let check = crate::participant::ValueCheck::new(&descriptor, false);
            let found = descriptor.invalid(payload.bytes()).next();
            assert_eq!(check.passes(payload.bytes()), found.is_none());
            found.map(|invalid| invalid.describe("a sample"))
        };
        assert_eq!(spoilt(6, 200), None);
        let named = "modes[1] = 4: its values are Wait (0), Approach (3), Hold (200)";
        assert_eq!(spoilt(7, 4).as_deref(), Some(named));
        assert_eq!(spoilt(9, 2).as_deref(), Some("armed[0][1] = 2: a bool is 0 or 1"));
    }

    #[test]
    fn state_with_invalid_enum_byte_is_rejected() {
        let saved = crate::participant::state::to_bytes(&report()).unwrap();
        assert_eq!(
            crate::participant::state::from_bytes::<Report>(&saved).unwrap(),
            report()
        );
        let mut spoilt = saved.clone();
        *spoilt.last_mut().unwrap() = 7;
        assert!(crate::participant::state::from_bytes::<Report>(&spoilt).is_err());
    }

    #[test]
    fn descriptor_validation_rejects_invalid_enumerations() {
        let spoil = |change: fn(&mut Descriptor)| {
            let mut bad = Report::descriptor();
            change(&mut bad);
            bad.validate().unwrap_err().to_string()
        };
        assert!(spoil(|d| d.fields[3].values.clear()).contains("name for 0"));
        assert!(spoil(|d| d.fields[3].values[0].value = 9).contains("name for 0"));
        assert!(spoil(|d| d.fields[3].values[1].value = 0).contains("same byte"));
        assert!(spoil(|d| d.fields[3].values[1].name = "Wait".into()).contains("same name"));
        assert!(spoil(|d| d.fields[3].values[1].name = "a=b".into()).contains("without"));
        assert!(spoil(|d| d.fields[3].unit = "m".into()).contains("no unit"));
        assert!(spoil(|d| d.fields[4].unit = "s".into()).contains("no unit"));
        assert!(spoil(|d| d.fields[4].values = d.fields[3].values.clone()).contains("only an enumeration"));
    }

    #[test]
    fn enum_values_are_parsed_from_text() {
        let list = EnumValue::list("closed = 0, open=1").unwrap();
        assert_eq!(list, [EnumValue::new("closed", 0), EnumValue::new("open", 1)]);
        for text in ["", "closed", "closed = 256", "closed = -1", "closed = 0,"] {
            assert!(EnumValue::list(text).is_err(), "{text}");
        }
    }
}
