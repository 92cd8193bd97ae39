//! Variable-length integers.

/// A variable-length integer as in Thrift and Protocol Buffers: seven bits per byte, least significant first.
pub(super) fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}
