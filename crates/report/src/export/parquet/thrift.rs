//! Thrift's compact protocol, the subset that Parquet's footer needs.

use crate::export::varint::varint;

const I32: u8 = 5;
const I64: u8 = 6;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const STRUCT: u8 = 12;

/// A structure under construction; fields must be added in ascending order of their number.
#[derive(Default)]
pub(super) struct Struct {
    bytes: Vec<u8>,
    last: u8,
}

impl Struct {
    fn field(&mut self, number: u8, kind: u8) {
        // The header holds the difference from the previous field number, which for Parquet's structures is always below
        // 16.
        self.bytes.push((number - self.last) << 4 | kind);
        self.last = number;
    }

    fn zigzag(&mut self, value: i64) {
        varint(&mut self.bytes, (value << 1 ^ value >> 63) as u64);
    }

    fn list(&mut self, number: u8, count: usize, kind: u8) {
        self.field(number, LIST);
        if count < 15 {
            self.bytes.push((count as u8) << 4 | kind);
        } else {
            self.bytes.push(0xf0 | kind);
            varint(&mut self.bytes, count as u64);
        }
    }

    fn raw_text(&mut self, text: &str) {
        varint(&mut self.bytes, text.len() as u64);
        self.bytes.extend_from_slice(text.as_bytes());
    }

    pub(super) fn i32(&mut self, number: u8, value: i32) -> &mut Struct {
        self.field(number, I32);
        self.zigzag(i64::from(value));
        self
    }

    pub(super) fn i64(&mut self, number: u8, value: i64) -> &mut Struct {
        self.field(number, I64);
        self.zigzag(value);
        self
    }

    pub(super) fn text(&mut self, number: u8, text: &str) -> &mut Struct {
        self.field(number, BINARY);
        self.raw_text(text);
        self
    }

    pub(super) fn i32_list(&mut self, number: u8, values: &[i32]) -> &mut Struct {
        self.list(number, values.len(), I32);
        for value in values {
            self.zigzag(i64::from(*value));
        }
        self
    }

    pub(super) fn text_list(&mut self, number: u8, values: &[&str]) -> &mut Struct {
        self.list(number, values.len(), BINARY);
        for value in values {
            self.raw_text(value);
        }
        self
    }

    pub(super) fn structure(&mut self, number: u8, inner: Struct) -> &mut Struct {
        self.field(number, STRUCT);
        self.bytes.extend(inner.end());
        self
    }

    pub(super) fn structures(&mut self, number: u8, inner: Vec<Struct>) -> &mut Struct {
        self.list(number, inner.len(), STRUCT);
        for one in inner {
            self.bytes.extend(one.end());
        }
        self
    }

    /// The bytes of the whole structure.
    pub(super) fn end(mut self) -> Vec<u8> {
        self.bytes.push(0);
        self.bytes
    }
}
