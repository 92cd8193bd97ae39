//! The instruction set that this code is compiled for.

/// The processor features that the compiled code requires and this processor lacks, in words; `None` when none is missing. If the
/// code was built outside the project's folder, it may be for any processor.
pub fn missing() -> Option<String> {
    #[cfg(target_arch = "x86_64")]
    {
        let needed = [
            (
                "AVX2",
                !cfg!(target_feature = "avx2") || std::arch::is_x86_feature_detected!("avx2"),
            ),
            (
                "FMA",
                !cfg!(target_feature = "fma") || std::arch::is_x86_feature_detected!("fma"),
            ),
            (
                "BMI2",
                !cfg!(target_feature = "bmi2") || std::arch::is_x86_feature_detected!("bmi2"),
            ),
        ];
        let missing = needed.iter().filter(|(_, there)| !there).map(|(name, _)| *name);
        let missing: Vec<&str> = missing.collect();
        if !missing.is_empty() {
            return Some(missing.join(", "));
        }
    }
    None
}
