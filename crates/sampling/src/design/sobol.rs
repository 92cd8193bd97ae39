//! Sobol' sequences with nested uniform scrambling (A. B. Owen, Randomly permuted (t,m,s)-nets and (t,s)-sequences, 1995).

use lockstep::random::Stream;

use super::joe_kuo::{DIMENSIONS, NUMBERS};
use super::uniform::{clamp_open, stream, uniform_open};

/// Bits of a point that the sequence determines: enough for 2^32 points.
pub(super) const BITS: u32 = 32;

/// The direction numbers of one dimension, each as a multiple of 2^-32.
#[derive(Debug, Clone)]
pub(super) struct Sequence([u32; BITS as usize]);

impl Sequence {
    pub(super) fn new(dimension: usize) -> Option<Sequence> {
        let mut directions = [0_u32; BITS as usize];
        if dimension >= DIMENSIONS {
            return None;
        }
        let Some(dimension) = dimension.checked_sub(1) else {
            // The first dimension is van der Corput's sequence.
            directions
                .iter_mut()
                .zip((0..BITS).rev())
                .for_each(|(one, bit)| *one = 1 << bit);
            return Some(Sequence(directions));
        };
        let degree_at = |at: usize| NUMBERS[at].ilog2() as usize;
        let at = (0..dimension).fold(0, |at, _| at + 1 + degree_at(at));
        let (polynomial, degree) = (u32::from(NUMBERS[at]), degree_at(at));
        for (number, place) in (0..degree).zip((0..BITS).rev()) {
            directions[number] = u32::from(NUMBERS[at + 1 + number]) << place;
        }
        for number in degree..BITS as usize {
            let before = directions[number - degree];
            let mut next = before ^ (before >> degree);
            for back in 1..degree {
                if polynomial >> (degree - back) & 1 == 1 {
                    next ^= directions[number - back];
                }
            }
            directions[number] = next;
        }
        Some(Sequence(directions))
    }

    /// Point `k` in the order of Antonov and Saleev (1979), which differs from the plain one only within blocks of powers of two.
    pub(super) fn at(&self, k: u64) -> u32 {
        let gray = k ^ (k >> 1);
        let own = self.0.iter().enumerate().filter(|(bit, _)| gray >> bit & 1 == 1);
        own.fold(0, |point, (_, direction)| point ^ direction)
    }
}

/// One dimension of a scrambled sequence.
#[derive(Debug, Clone)]
pub(super) struct Scrambled {
    sequence: Sequence,
    flip_bits: Stream,
    low_bits: Stream,
}

impl Scrambled {
    pub(super) fn new(seed: u64, name: &str, dimension: usize) -> Option<Scrambled> {
        Some(Scrambled {
            sequence: Sequence::new(dimension)?,
            flip_bits: Stream::new(seed, &format!("scramble {name}")),
            low_bits: stream(seed, name),
        })
    }

    /// Each bit is flipped at random, depending on the bits before it; the bits below the sequence's resolution are uniform.
    pub(super) fn at(&self, k: u64) -> f64 {
        let plain = self.sequence.at(k);
        let mut scrambled = plain;
        for bit in 0..BITS {
            let before = (u64::from(plain) >> (BITS - bit)) | (1 << bit);
            let flip = (self.flip_bits.bits(before) & 1) as u32;
            scrambled ^= flip << (BITS - 1 - bit);
        }
        clamp_open((f64::from(scrambled) + uniform_open(&self.low_bits, k)) / 4_294_967_296.0)
    }
}
