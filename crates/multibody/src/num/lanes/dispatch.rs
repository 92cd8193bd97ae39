//! The number of lanes that this processor has, found when the program runs.

use core::marker::PhantomData;

use super::vectors::F64x4;
#[cfg(target_arch = "x86_64")]
use super::{eight, vectors::F64x8};
use crate::num::number::{Computation, Lanes};

/// Code that is compiled for every number of lanes, for [`with_lanes`].
pub trait ForLanes {
    /// What it computes.
    type Output;

    /// The computation in lanes of type `T`; `#[inline(always)]`, so that it is compiled for their instructions.
    fn run<T: Lanes>(self) -> Self::Output;
}

/// Runs `code` in the narrowest lanes of this processor that hold `count` doubles, in the widest where none do.
///
/// ```
/// use multibody::{ForLanes, Lanes, with_lanes};
///
/// struct Cubes<'a>(&'a mut [f64]);
///
/// impl ForLanes for Cubes<'_> {
///     type Output = ();
///     #[inline(always)]
///     fn run<T: Lanes>(self) {
///         for part in self.0.chunks_mut(T::WIDTH) {
///             let x = T::gather(|lane| part.get(lane).copied().unwrap_or(0.0));
///             let cubes = x * x * x;
///             for (lane, one) in part.iter_mut().enumerate() {
///                 *one = cubes.lane(lane);
///             }
///         }
///     }
/// }
///
/// let mut x = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
/// with_lanes(x.len(), Cubes(&mut x)); // two passes of four lanes, or one of eight
/// assert_eq!(x, [1.0, 8.0, 27.0, 64.0, 125.0, 216.0]);
/// ```
#[inline]
pub fn with_lanes<C: ForLanes>(count: usize, code: C) -> C::Output {
    #[cfg(target_arch = "x86_64")]
    if count > F64x4::WIDTH && eight::is_available() {
        return F64x8::compute(InLanes(code, PhantomData::<F64x8>));
    }
    let _ = count;
    code.run::<F64x4>()
}

/// The largest number of lanes of this processor.
///
/// ```
/// assert!([4, 8].contains(&multibody::lanes_max()));
/// ```
pub fn lanes_max() -> usize {
    #[cfg(target_arch = "x86_64")]
    if eight::is_available() {
        return F64x8::WIDTH;
    }
    F64x4::WIDTH
}

/// A [`ForLanes`] in lanes of type `T`.
struct InLanes<C, T>(C, PhantomData<T>);

impl<C: ForLanes, T: Lanes> Computation for InLanes<C, T> {
    type Output = C::Output;

    #[inline(always)]
    fn run(self) -> C::Output {
        self.0.run::<T>()
    }
}
