//! The memory of a port: an array of Python's that stays where it is.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The bytes of a port's message. As long as this lives the array can neither go nor be resized.
pub(crate) struct Memory {
    buffer: PyBuffer<u8>,
    size: usize,
}

impl Memory {
    /// The first `size` bytes of `array`.
    ///
    /// # Errors
    /// When it has fewer, cannot be written, or does not lie in one piece.
    pub(crate) fn of(array: &Bound<'_, PyAny>, size: usize) -> PyResult<Memory> {
        let buffer = PyBuffer::<u8>::get(array)?;
        if buffer.readonly() || !buffer.is_c_contiguous() || buffer.len_bytes() < size {
            return Err(PyValueError::new_err(
                "the memory of a port was replaced by another array",
            ));
        }
        Ok(Memory { buffer, size })
    }

    /// All of an array of `count` doubles.
    ///
    /// # Errors
    /// When it has other elements, or another number of them.
    pub(crate) fn of_doubles(array: &Bound<'_, PyAny>, count: usize) -> PyResult<Memory> {
        if PyBuffer::<f64>::get(array)?.item_count() != count {
            return Err(PyValueError::new_err(format!("an array of {count} doubles is needed")));
        }
        Memory::of(&array.call_method1("view", ("u1",))?, 8 * count)
    }

    fn at(&self) -> *mut u8 {
        self.buffer.buf_ptr().cast()
    }

    /// Puts `bytes` there. The interpreter is held: nobody else writes.
    pub(crate) fn put(&self, _held: Python<'_>, bytes: &[u8]) {
        let count = self.size.min(bytes.len());
        // SAFETY: the export keeps the memory, which has `size` bytes and is writable; `bytes` is memory of Rust's and no part of it.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), self.at(), count) }
    }

    /// Copies what is there to `bytes`.
    pub(crate) fn take(&self, _held: Python<'_>, bytes: &mut [u8]) {
        let count = self.size.min(bytes.len());
        // SAFETY: as above, the other way round.
        unsafe { std::ptr::copy_nonoverlapping(self.at().cast_const(), bytes.as_mut_ptr(), count) }
    }
}
