//! Doubles in SIMD lanes.
//!
//! Each operation acts on the lanes separately and rounds each as the scalar operation does, so a kernel run in lanes is bit-identical in
//! every lane to a run on that state alone.
//!
//! | type | instructions | without them |
//! |---|---|---|
//! | [`F64x4`] | AVX2 and FMA, compiled in (the workspace's `x86-64-v3` baseline) | loops over four, the same bits, slower |
//! | `F64x8` | AVX-512, found when the program runs | the type cannot be obtained |

mod dispatch;
#[cfg(target_arch = "x86_64")]
mod eight;
#[cfg(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma"))]
mod four_avx2;
#[cfg(not(all(target_arch = "x86_64", target_feature = "avx2", target_feature = "fma")))]
mod four_portable;
mod vectors;

pub use dispatch::{ForLanes, lanes_max, with_lanes};
pub use vectors::F64x4;
