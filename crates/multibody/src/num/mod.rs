//! Numbers: the scalar trait of the kernels, SIMD lanes, sines and cosines, 3-vectors.
//!
//! Everything here is deterministic: additions, products, square roots and fused multiply-adds are correctly rounded
//! by IEEE 754, and nothing else is used. No function of the C library is called, so no result depends on the
//! processor a process happens to run on.

mod double;
mod lanes;
mod list;
mod number;
mod real;
mod space;
mod trig;

pub use lanes::{F64x4, ForLanes, lanes_max, with_lanes};
pub(crate) use list::{Dynamic, Fixed, List, Size, Static};
pub(crate) use number::Constant;
pub use number::{Computation, Lanes, Number};
pub use real::Real;
pub(crate) use space::{Mat3, Sym3, V3};
pub use trig::sin_cos;
