//! Scratch lists filled front to back: on the stack when the number of joints is a constant, on the heap when it is
//! only known at run time. The kernels are written once over [`Size`] and compiled for both.

use core::mem::MaybeUninit;
use core::ops::{Deref, DerefMut};

/// Storage of scratch lists.
pub(crate) trait Size {
    /// A list of `X`.
    type List<X: Copy>: List<X>;
}

/// A list that only grows.
pub(crate) trait List<X>: DerefMut<Target = [X]> {
    fn with_capacity(n: usize) -> Self;
    fn push(&mut self, x: X);
}

/// At most `N + 1` elements (the base and `N` bodies), on the stack.
pub(crate) struct Static<const N: usize>;
/// Any number of elements, on the heap.
pub(crate) struct Dynamic;

impl<const N: usize> Size for Static<N> {
    type List<X: Copy> = Fixed<X, N>;
}

impl Size for Dynamic {
    type List<X: Copy> = Vec<X>;
}

impl<X> List<X> for Vec<X> {
    fn with_capacity(n: usize) -> Self {
        Vec::with_capacity(n)
    }
    fn push(&mut self, x: X) {
        Vec::push(self, x);
    }
}

/// Room for `N + 1` elements, of which the first `len` are initialised. Zeroing a few kilobytes of scratch first would
/// cost a tenth of a forward-dynamics call, which is the only reason why this is not a plain array.
#[derive(Clone)]
pub(crate) struct Fixed<X: Copy, const N: usize> {
    items: ArrayPlusOne<X, N>,
    len: usize,
}

/// `[X; N + 1]`, which stable Rust cannot express: `repr(C)` lays the fields out consecutively, and both have the
/// alignment of `X`, so there is no padding.
#[derive(Clone)]
#[repr(C)]
struct ArrayPlusOne<X: Copy, const N: usize> {
    first: MaybeUninit<X>,
    others: [MaybeUninit<X>; N],
}

impl<X: Copy, const N: usize> List<X> for Fixed<X, N> {
    #[inline(always)]
    fn with_capacity(_: usize) -> Self {
        Self {
            items: ArrayPlusOne {
                first: MaybeUninit::uninit(),
                others: [const { MaybeUninit::uninit() }; N],
            },
            len: 0,
        }
    }
    #[inline(always)]
    fn push(&mut self, x: X) {
        assert!(self.len <= N);
        // SAFETY: `ArrayPlusOne<X, N>` has the layout of [X; N + 1], and `len` ≤ N was just checked.
        unsafe { (&raw mut self.items).cast::<X>().add(self.len).write(x) };
        self.len += 1;
    }
}

impl<X: Copy, const N: usize> Deref for Fixed<X, N> {
    type Target = [X];
    #[inline(always)]
    fn deref(&self) -> &[X] {
        // SAFETY: `push` is the only writer of `len` and initialises the element before counting it, so the first
        // `len` (≤ N + 1, or `push` would have panicked) elements are initialised; OneMore<X, N> has
        // the layout of [X; N + 1].
        unsafe { core::slice::from_raw_parts((&raw const self.items).cast(), self.len) }
    }
}

impl<X: Copy, const N: usize> DerefMut for Fixed<X, N> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [X] {
        // SAFETY: as in `deref`, and `self` is borrowed mutably for as long as the slice lives.
        unsafe { core::slice::from_raw_parts_mut((&raw mut self.items).cast(), self.len) }
    }
}

impl<X: Copy + core::fmt::Debug, const N: usize> core::fmt::Debug for Fixed<X, N> {
    fn fmt(&self, f: &mut core::fmt::Formatter) -> core::fmt::Result {
        f.debug_list().entries(self.iter()).finish()
    }
}
