//! The instruction set that this program is compiled for.

/// Refuses a processor that lacks what the compiled code takes for granted.
pub fn check() -> Result<(), String> {
    let needed = [
        // Built elsewhere than in the project's folder, the program may be for any processor.
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
    let missing: Vec<&str> = needed
        .iter()
        .filter(|(_, there)| !there)
        .map(|(name, _)| *name)
        .collect();
    if missing.is_empty() {
        return Ok(());
    }
    Err(format!(
        "this program is compiled for x86-64-v3 processors (2013 and later) and this one lacks {}: remove the line `rustflags` from \
         .cargo/config.toml and build again; results stay the same to the last bit, at a fraction of the speed",
        missing.join(", ")
    ))
}
