//! Memory for foreign code, with guards around each piece that detect out-of-bounds writes.

/// The guard between two pieces, bytes.
const GUARD: usize = 64;
/// The fill byte of a guard: not part of an address, a small number or a text.
const PATTERN: u8 = 0xa5;
/// The alignment of pieces, bytes.
const ALIGNMENT: usize = 16;

/// Zeroed pieces, each aligned to 16 bytes, with a guard before and after it.
#[derive(Debug)]
pub(crate) struct Guarded {
    memory: Vec<u128>,
    /// Start and size of each piece, bytes.
    pieces: Vec<(usize, usize)>,
}

impl Guarded {
    pub(crate) fn zeroed(sizes: impl IntoIterator<Item = usize>) -> Guarded {
        let mut pieces = Vec::new();
        let mut end = GUARD;
        for size in sizes {
            pieces.push((end, size));
            // The guard begins directly after the last byte.
            end = (end + size + GUARD).next_multiple_of(ALIGNMENT);
        }
        let mut guarded = Guarded {
            memory: vec![u128::from_ne_bytes([PATTERN; 16]); end.div_ceil(16)],
            pieces,
        };
        for piece in 0..guarded.pieces.len() {
            guarded.piece_mut(piece).fill(0);
        }
        guarded
    }

    fn bytes(&self) -> &[u8] {
        let length = self.memory.len() * 16;
        // SAFETY: the bytes of a list of numbers are valid bytes.
        unsafe { std::slice::from_raw_parts(self.memory.as_ptr().cast(), length) }
    }

    pub(crate) fn piece(&self, piece: usize) -> &[u8] {
        let (start, size) = self.pieces[piece];
        &self.bytes()[start..start + size]
    }

    pub(crate) fn piece_mut(&mut self, piece: usize) -> &mut [u8] {
        let (start, size) = self.pieces[piece];
        let length = self.memory.len() * 16;
        // SAFETY: any bytes are valid numbers.
        let bytes = unsafe { std::slice::from_raw_parts_mut(self.memory.as_mut_ptr().cast::<u8>(), length) };
        &mut bytes[start..start + size]
    }

    /// The address of each piece. The addresses are valid as long as this exists.
    pub(crate) fn addresses(&mut self) -> impl Iterator<Item = *mut u8> + '_ {
        let base = self.memory.as_mut_ptr().cast::<u8>();
        // SAFETY: each piece lies in the memory.
        self.pieces.iter().map(move |(start, _)| unsafe { base.add(*start) })
    }

    /// `None` if all guards are intact; otherwise the piece whose guard is not, and whether it was written past its end (or before its
    /// start).
    pub(crate) fn first_broken(&self) -> Option<(usize, bool)> {
        let bytes = self.bytes();
        let mut from = 0;
        for (piece, &(start, size)) in self.pieces.iter().enumerate() {
            if !is_intact(&bytes[from..start]) {
                // A guard between two pieces: the nearer piece is the one that broke it.
                let first = from + bytes[from..start].iter().position(|byte| *byte != PATTERN).unwrap_or(0);
                return Some(if piece > 0 && first - from < start - first {
                    (piece - 1, true)
                } else {
                    (piece, false)
                });
            }
            from = start + size;
        }
        (!self.pieces.is_empty() && !is_intact(&bytes[from..])).then(|| (self.pieces.len() - 1, true))
    }
}

/// Whether a guard is intact. Checks all bytes without branching: it is on the path of every step.
fn is_intact(guard: &[u8]) -> bool {
    guard.iter().fold(0, |found, byte| found | (byte ^ PATTERN)) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn guard_detects_write_one_byte_past_piece() {
        for piece in 0..3 {
            for (past, overrun) in [(true, true), (false, false)] {
                let mut guarded = Guarded::zeroed([8, 13, 216]);
                assert_eq!(guarded.first_broken(), None);
                assert!(guarded.piece(piece).iter().all(|byte| *byte == 0));
                let size = guarded.pieces[piece].1;
                let at = guarded.addresses().nth(piece).unwrap();
                assert_eq!(at as usize % ALIGNMENT, 0);
                // SAFETY: there is a guard on both sides.
                unsafe { if past { at.add(size) } else { at.sub(1) }.write(1) };
                assert_eq!(guarded.first_broken(), Some((piece, overrun)), "piece {piece}");
            }
        }
    }

    #[test]
    fn guarded_memory_without_pieces_is_intact() {
        assert_eq!(Guarded::zeroed([]).first_broken(), None);
    }
}
