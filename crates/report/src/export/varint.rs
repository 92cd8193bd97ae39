//! Numbers of variable length.

/// A number of variable length, as Thrift and Protocol Buffers have it: seven bits a byte, least significant first.
pub(super) fn varint(out: &mut Vec<u8>, mut value: u64) {
    while value >= 0x80 {
        out.push(value as u8 | 0x80);
        value >>= 7;
    }
    out.push(value as u8);
}
