//! Texts and bytes of varying length in fixed room.

use std::fmt;

use super::{Element, EnumValue, FieldType};

/// A text of at most `N` bytes: UTF-8, padded with zeros. In C it is `char name[N]`, which a text may fill to the last byte: no
/// terminating zero is needed.
///
/// ```
/// use lockstep::port::Text;
/// let mut name: Text<8> = Text::new("ready").unwrap();
/// assert_eq!(name.as_str(), "ready");
/// assert!(name.set("too long for it").is_err());
/// ```
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(transparent)]
pub struct Text<const N: usize>([u8; N]);

/// At most `N` bytes: their number, 32 bits, little-endian, then the bytes, padded with zeros.
///
/// ```
/// use lockstep::port::Bytes;
/// let frame: Bytes<8> = Bytes::new(&[1, 2, 3]).unwrap();
/// assert_eq!(frame.as_slice(), [1, 2, 3]);
/// ```
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[repr(C)]
pub struct Bytes<const N: usize> {
    length: [u8; 4],
    data: [u8; N],
}

/// A text or bytes that exceed their room.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{length} bytes do not fit into {room}")]
pub struct TooLong {
    /// The actual number of bytes.
    pub length: usize,
    /// The allowed number of bytes.
    pub room: usize,
}

/// The content of one element of a field of texts or bytes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Content<'a> {
    /// A text.
    Text(&'a str),
    /// Bytes.
    Bytes(&'a [u8]),
}

impl fmt::Display for Content<'_> {
    /// `"ready"`, `3 bytes 0a1b2c`
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        const SHOWN: usize = 16;
        match self {
            Content::Text(text) => write!(f, "{text:?}"),
            Content::Bytes(bytes) => {
                write!(f, "{} bytes ", bytes.len())?;
                bytes.iter().take(SHOWN).try_for_each(|byte| write!(f, "{byte:02x}"))?;
                f.write_str(if bytes.len() > SHOWN { "…" } else { "" })
            }
        }
    }
}

impl Content<'_> {
    /// The bytes.
    pub fn as_bytes(&self) -> &[u8] {
        match self {
            Content::Text(text) => text.as_bytes(),
            Content::Bytes(bytes) => bytes,
        }
    }
}

impl Element {
    /// Bytes before the room of [`Element::Bytes`]: their number.
    const LENGTH: usize = 4;

    /// The most bytes of a text or bytes; `None` for other types.
    pub const fn room(self) -> Option<usize> {
        match self {
            Element::Text(room) | Element::Bytes(room) => Some(room as usize),
            _ => None,
        }
    }

    /// The content of an element that is a text or bytes. `bytes` starts at the element.
    ///
    /// # Errors
    /// What is wrong with the bytes, or that the element is a number.
    pub fn content(self, bytes: &[u8]) -> Result<Content<'_>, String> {
        match self {
            Element::Text(room) => {
                let bytes = &bytes[..room as usize];
                let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
                if let Some(at) = bytes[end..].iter().position(|byte| *byte != 0) {
                    return Err(format!(
                        "the text ends at byte {end}, and byte {} behind it is not zero",
                        end + at
                    ));
                }
                let text = std::str::from_utf8(&bytes[..end]);
                text.map(Content::Text)
                    .map_err(|error| format!("it is not UTF-8 from byte {} on", error.valid_up_to()))
            }
            Element::Bytes(room) => {
                let room = room as usize;
                let (length, data) = bytes[..Self::LENGTH + room].split_at(Self::LENGTH);
                let length = Element::U32.to_integer(length) as usize;
                if length > room {
                    return Err(format!("its length is {length}, and it has room for {room} bytes"));
                }
                if data[length..].iter().any(|byte| *byte != 0) {
                    return Err(format!("bytes behind its {length} bytes are not zero"));
                }
                Ok(Content::Bytes(&data[..length]))
            }
            other => Err(format!("it is {other}")),
        }
    }

    /// Writes a text or bytes to the bytes of an element.
    ///
    /// # Errors
    /// When the content does not fit: nothing is truncated.
    pub fn put_content(self, content: &[u8], bytes: &mut [u8]) -> Result<(), TooLong> {
        let room = self.room().unwrap_or(0);
        let length = content.len();
        if length > room {
            return Err(TooLong { length, room });
        }
        let start = self.size() - room;
        bytes.fill(0);
        if let Element::Bytes(_) = self {
            bytes[..start].copy_from_slice(&(length as u32).to_le_bytes());
        }
        bytes[start..start + length].copy_from_slice(content);
        Ok(())
    }

    /// A number that is the same for equal contents, and 0 for empty ones: 53 bits of a hash.
    pub(super) fn fingerprint(self, bytes: &[u8]) -> f64 {
        let bytes = &bytes[..self.size()];
        let end = bytes.iter().rposition(|byte| *byte != 0).map_or(0, |last| last + 1);
        match end {
            0 => 0.0,
            _ => ((crate::fnv::fnv1a(&bytes[..end]) >> 11) | 1) as f64,
        }
    }
}

impl<const N: usize> Text<N> {
    /// Creates a text.
    ///
    /// # Errors
    /// When it is longer than `N` bytes. A zero byte inside the text ends it.
    pub fn new(text: &str) -> Result<Text<N>, TooLong> {
        let mut own = Text([0; N]);
        own.set(text).map(|()| own)
    }

    /// Replaces the text.
    ///
    /// # Errors
    /// As for [`Text::new`]; the text is then unchanged.
    pub fn set(&mut self, text: &str) -> Result<(), TooLong> {
        let text = text.split('\0').next().unwrap_or_default();
        Element::Text(N as u32).put_content(text.as_bytes(), &mut self.0)
    }

    /// The text.
    pub fn as_str(&self) -> &str {
        match Element::Text(N as u32).content(&self.0) {
            Ok(Content::Text(text)) => text,
            _ => "",
        }
    }
}

impl<const N: usize> Bytes<N> {
    /// Creates bytes.
    ///
    /// # Errors
    /// When there are more than `N`.
    pub fn new(bytes: &[u8]) -> Result<Bytes<N>, TooLong> {
        let mut own = Bytes::default();
        own.set(bytes).map(|()| own)
    }

    /// Replaces the bytes.
    ///
    /// # Errors
    /// As for [`Bytes::new`]; the bytes are then unchanged.
    pub fn set(&mut self, bytes: &[u8]) -> Result<(), TooLong> {
        let length = bytes.len();
        if length > N {
            return Err(TooLong { length, room: N });
        }
        self.length = (length as u32).to_le_bytes();
        self.data = [0; N];
        self.data[..length].copy_from_slice(bytes);
        Ok(())
    }

    /// The bytes.
    pub fn as_slice(&self) -> &[u8] {
        &self.data[..u32::from_le_bytes(self.length) as usize]
    }
}

impl<const N: usize> Default for Text<N> {
    fn default() -> Self {
        Text([0; N])
    }
}

impl<const N: usize> Default for Bytes<N> {
    fn default() -> Self {
        Bytes {
            length: [0; 4],
            data: [0; N],
        }
    }
}

impl<const N: usize> fmt::Debug for Text<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.as_str())
    }
}

impl<const N: usize> fmt::Debug for Bytes<N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}", self.as_slice())
    }
}

// SAFETY: the bits are bytes, and those that are not a text are rejected; zeros are the empty text.
unsafe impl<const N: usize> FieldType for Text<N>
where
    [u8; N]: bytemuck::Pod,
{
    type Bits = [u8; N];
    const ELEMENT: Element = Element::Text(N as u32);
    fn extents(_: &mut Vec<u32>) {}
    fn values() -> Vec<EnumValue> {
        Vec::new()
    }
    fn is_valid(bits: &[u8; N]) -> bool {
        Self::ELEMENT.content(bits).is_ok()
    }
}

/// The bits of [`Bytes`].
#[doc(hidden)]
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct BytesBits<const N: usize>([u8; 4], [u8; N]);

// SAFETY: zeros are bytes.
unsafe impl<const N: usize> bytemuck::Zeroable for BytesBits<N> {}
// SAFETY: only bytes, contiguous.
unsafe impl<const N: usize> bytemuck::Pod for BytesBits<N> {}

// SAFETY: as for texts: the layout is that of the bits, and a length beyond the room is rejected.
unsafe impl<const N: usize> FieldType for Bytes<N> {
    type Bits = BytesBits<N>;
    const ELEMENT: Element = Element::Bytes(N as u32);
    fn extents(_: &mut Vec<u32>) {}
    fn is_valid(bits: &BytesBits<N>) -> bool {
        let length = u32::from_le_bytes(bits.0) as usize;
        bits.1
            .get(length..)
            .is_some_and(|rest| rest.iter().all(|byte| *byte == 0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::participant::{Payload, ValueCheck};
    use crate::port::{Descriptor, Message};

    crate::message! {
        struct Report {
            count: u32 = "1",
            phase: Text<8> = "1",
            names: [Text<4>; 2] = "1",
            frame: Bytes<6> = "1",
            end: [u8; 2] = "1",
        }
    }

    fn report() -> Report {
        Report {
            count: 7,
            phase: Text::new("ready").unwrap(),
            names: [Text::new("Höl").unwrap(), Text::default()],
            frame: Bytes::new(&[1, 0, 255]).unwrap(),
            end: [0; 2],
        }
    }

    #[test]
    fn descriptor_states_room_of_texts_and_bytes() {
        let descriptor = Report::descriptor();
        assert_eq!(descriptor.validate(), Ok(()));
        assert_eq!(descriptor.size, 32);
        assert_eq!(descriptor.fields[1].to_string(), "phase: text[8]");
        assert_eq!(descriptor.fields[2].to_string(), "names: text[4][2]");
        assert_eq!(descriptor.fields[3].range(), 20..30);
        assert!(descriptor.canonical().contains("names|text[4]|2|1||12\n"));
        let payload = Payload::of(&report());
        assert_eq!(payload.get::<Report>(), report());
        let shown = |name: &str, index| descriptor.field(name).unwrap().shown(payload.bytes(), index);
        assert_eq!(shown("phase", 0), "\"ready\"");
        assert_eq!(shown("names", 0), "\"Höl\"");
        assert_eq!(shown("frame", 0), "3 bytes 0100ff");
        let phase = descriptor.field("phase").unwrap();
        assert_ne!(phase.value(payload.bytes(), 0), 0.0);
        assert_eq!(descriptor.field("names").unwrap().value(payload.bytes(), 1), 0.0);
    }

    #[test]
    fn value_check_rejects_invalid_texts_and_bytes() {
        let descriptor = Report::descriptor();
        let check = ValueCheck::new(&descriptor, true);
        let spoilt = |changes: &[(usize, u8)]| {
            let mut payload = Payload::of(&report());
            changes.iter().for_each(|&(at, byte)| payload.bytes_mut()[at] = byte);
            let found = check.describe_invalid(&descriptor, payload.bytes(), "a sample");
            assert_eq!(check.passes(payload.bytes()), found.is_empty());
            assert_eq!(
                bytemuck::checked::try_from_bytes::<Report>(payload.bytes()).is_ok(),
                found.is_empty()
            );
            found
        };
        assert_eq!(spoilt(&[]), "");
        assert_eq!(spoilt(&[(9, b'!')]), "");
        assert_eq!(spoilt(&[(5, 0xff)]), "phase: it is not UTF-8 from byte 1 on");
        assert_eq!(
            spoilt(&[(10, b'x')]),
            "phase: the text ends at byte 5, and byte 6 behind it is not zero"
        );
        assert_eq!(
            spoilt(&[(18, 0xc3)]),
            "names[1]: the text ends at byte 0, and byte 2 behind it is not zero"
        );
        assert_eq!(
            spoilt(&[(20, 7)]),
            "frame: its length is 7, and it has room for 6 bytes"
        );
        assert_eq!(spoilt(&[(29, 1)]), "frame: bytes behind its 3 bytes are not zero");
    }

    #[test]
    fn text_and_bytes_reject_content_beyond_room() {
        let mut text = Text::<4>::new("abcd").unwrap();
        assert_eq!(text.set("abcde"), Err(TooLong { length: 5, room: 4 }));
        assert_eq!(text.as_str(), "abcd");
        assert!(Text::<2>::new("€").is_err());
        assert!(Bytes::<2>::new(&[1, 2, 3]).is_err());
    }

    #[test]
    fn element_holds_texts_and_bytes_with_less_room() {
        let (small, large) = (Element::Text(4), Element::Text(8));
        assert!(large.holds(small) && !small.holds(large) && large.holds(large));
        assert!(Element::Bytes(8).holds(Element::Bytes(8)) && !Element::Bytes(8).holds(small));
        for number in [Element::F64, Element::I64, Element::U8, Element::Enum] {
            assert!(!number.holds(small) && !small.holds(number));
        }
    }

    #[test]
    fn descriptor_validation_rejects_invalid_room() {
        let spoil = |change: fn(&mut Descriptor)| {
            let mut bad = Report::descriptor();
            change(&mut bad);
            bad.validate().unwrap_err().to_string()
        };
        assert!(spoil(|d| d.fields[1].unit = "m".into()).contains("no unit"));
        assert!(spoil(|d| d.fields[1].element = Element::Text(0)).contains("room"));
        assert!(spoil(|d| d.fields[1].element = Element::Text(u32::MAX)).contains("room"));
        assert!(spoil(|d| d.fields[3].element = Element::Bytes(u32::MAX)).contains("room"));
        assert!(spoil(|d| d.fields[1].element = Element::Text(9)).contains("start where"));
    }
}
