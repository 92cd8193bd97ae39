//! LZ4, the subset that a chunk needs: one frame of independent blocks.
//!
//! A block is a sequence of literals and of copies of up to 64 KiB earlier data. Matches are found by a hash table of the
//! last position of each four bytes, with a single look-up per position: fast, and good enough for numbers that repeat. See
//! the LZ4 block and frame formats.

/// The start of every frame: magic number, version 1 with independent blocks of at most 4 MiB, checksum of these two bytes.
const FRAME_HEADER: [u8; 7] = [0x04, 0x22, 0x4d, 0x18, 0x60, 0x70, 0x73];
/// Bytes of a block before it is compressed.
const BLOCK: usize = 4 << 20;
/// The flag of a block that is not compressed.
const UNCOMPRESSED: u32 = 1 << 31;
/// Minimum length of a copy.
const COPY_MIN: usize = 4;
/// This many bytes at the end are literals, and the last copy starts at least this many bytes before the end.
const TAIL_LITERALS: usize = 5;
const LAST_COPY: usize = 12;
/// Maximum distance of a copy.
const DISTANCE_MAX: usize = 65_535;
const TABLE_BITS: u32 = 14;

/// Compresses `bytes` to a frame.
pub(super) fn frame(bytes: &[u8]) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len() / 2 + 64);
    out.extend(FRAME_HEADER);
    let mut table = vec![0; 1 << TABLE_BITS];
    for block in bytes.chunks(BLOCK) {
        let size_at = out.len();
        out.extend([0; 4]);
        table.fill(0);
        compress(block, &mut table, &mut out);
        let mut size = (out.len() - size_at - 4) as u32;
        if size as usize >= block.len() {
            out.truncate(size_at + 4);
            out.extend(block);
            size = block.len() as u32 | UNCOMPRESSED;
        }
        out[size_at..size_at + 4].copy_from_slice(&size.to_le_bytes());
    }
    out.extend([0; 4]);
    out
}

/// Appends the compressed `block` to `out`. `table` starts with zeros; then it maps a hash of four bytes to their position
/// plus one.
fn compress(block: &[u8], table: &mut [u32], out: &mut Vec<u8>) {
    let four = |at: usize| u32::from_le_bytes([block[at], block[at + 1], block[at + 2], block[at + 3]]);
    let (mut at, mut written) = (0, 0);
    let end = block.len().saturating_sub(LAST_COPY);
    while at < end {
        let bytes = four(at);
        let slot = &mut table[(bytes.wrapping_mul(2_654_435_761) >> (32 - TABLE_BITS)) as usize];
        let before = std::mem::replace(slot, at as u32 + 1) as usize;
        let from = before.wrapping_sub(1);
        if before == 0 || at - from > DISTANCE_MAX || four(from) != bytes {
            // Where nothing repeats, the search step grows.
            at += 1 + ((at - written) >> 6);
            continue;
        }
        let room = block.len() - TAIL_LITERALS - at;
        let same = (COPY_MIN..room)
            .take_while(|&n| block[from + n] == block[at + n])
            .count();
        let length = COPY_MIN + same;
        sequence(&block[written..at], Some((at - from, length)), out);
        at += length;
        written = at;
    }
    sequence(&block[written..], None, out);
}

/// Literals, then a copy of `length` bytes from `distance` before.
fn sequence(literals: &[u8], copy: Option<(usize, usize)>, out: &mut Vec<u8>) {
    let more = copy.map_or(0, |(_, length)| length - COPY_MIN);
    out.push((literals.len().min(15) << 4 | more.min(15)) as u8);
    write_length_remainder(literals.len(), out);
    out.extend(literals);
    if let Some((distance, _)) = copy {
        out.extend((distance as u16).to_le_bytes());
        write_length_remainder(more, out);
    }
}

/// The part of a length that does not fit into the four bits before.
fn write_length_remainder(length: usize, out: &mut Vec<u8>) {
    if let Some(mut rest) = length.checked_sub(15) {
        while rest >= 255 {
            out.push(255);
            rest -= 255;
        }
        out.push(rest as u8);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The content of a frame, decoded by the rules of the format only.
    fn unpack(frame: &[u8]) -> Vec<u8> {
        let mut rest = frame.strip_prefix(&FRAME_HEADER).expect("a frame");
        let mut all = Vec::new();
        loop {
            let (size, behind) = rest.split_first_chunk::<4>().expect("a size");
            let size = u32::from_le_bytes(*size);
            if size == 0 {
                assert!(behind.is_empty());
                return all;
            }
            let (block, behind) = behind.split_at((size & !UNCOMPRESSED) as usize);
            if size & UNCOMPRESSED == 0 {
                unpack_block(block, &mut all);
            } else {
                all.extend(block);
            }
            rest = behind;
        }
    }

    fn unpack_block(mut block: &[u8], all: &mut Vec<u8>) {
        let begin = all.len();
        let byte = |block: &mut &[u8]| {
            let (first, rest) = block.split_first().expect("a byte");
            *block = rest;
            usize::from(*first)
        };
        let length = |nibble: usize, block: &mut &[u8]| {
            let mut length = nibble;
            let mut more = if nibble == 15 { 255 } else { 0 };
            while more == 255 {
                more = byte(block);
                length += more;
            }
            length
        };
        loop {
            let token = byte(&mut block);
            let literals = length(token >> 4, &mut block);
            all.extend(&block[..literals]);
            block = &block[literals..];
            if block.is_empty() {
                assert!(
                    literals >= TAIL_LITERALS || all.len() - begin < LAST_COPY,
                    "the end is literal"
                );
                return;
            }
            let distance = byte(&mut block) | byte(&mut block) << 8;
            let length = COPY_MIN + length(token & 15, &mut block);
            assert!(
                0 < distance && distance <= all.len() - begin,
                "a copy stays in its block"
            );
            for _ in 0..length {
                all.push(all[all.len() - distance]);
            }
        }
    }

    proptest! {
        #[test]
        fn lz4_frame_decodes_to_its_input(pieces in prop::collection::vec((prop::collection::vec(any::<u8>(), 0..40), 1_usize..30), 0..60)) {
            let bytes: Vec<u8> = pieces.into_iter().flat_map(|(piece, times)| piece.repeat(times)).collect();
            prop_assert_eq!(unpack(&frame(&bytes)), bytes);
        }
    }

    #[test]
    fn lz4_shrinks_repeated_numbers_and_does_not_grow_noise() {
        let steps: Vec<u8> = (0..200_000_u64).flat_map(|at| (at / 100).to_le_bytes()).collect();
        let packed = frame(&steps);
        assert_eq!(unpack(&packed), steps);
        assert!(packed.len() < steps.len() / 20, "{} of {}", packed.len(), steps.len());
        let draws = lockstep::random::Stream::new(3, "noise");
        let noise: Vec<u8> = (0..700_000).flat_map(|at| draws.bits(at).to_le_bytes()).collect();
        let packed = frame(&noise);
        assert_eq!(unpack(&packed), noise);
        assert!(packed.len() <= noise.len() + 32);
    }
}
