//! Random numbers for tests: the same ones on every machine.

/// SplitMix64 (Steele, Lea and Flood 2014), from a seed.
#[derive(Debug, Clone)]
pub struct SplitMix(pub u64);

impl SplitMix {
    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// The two uniform numbers of a normal one by Box and Muller: the first lies in (0, 1].
    pub fn pair(&mut self) -> (f64, f64) {
        (1.0 - self.uniform(), self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::SplitMix;

    /// The first numbers from seed 0 as the authors' own program gives them.
    #[test]
    fn splitmix_matches_published_numbers() {
        let mut random = SplitMix(0);
        assert_eq!(
            [random.bits(), random.bits(), random.bits()],
            [0xe220_a839_7b1d_cdaf, 0x6e78_9e6a_a1b9_65f4, 0x06c4_5d18_8009_454f]
        );
    }
}
