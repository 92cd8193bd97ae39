//! The memory of a port: a Python array at a fixed address.

use pyo3::buffer::PyBuffer;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

/// The bytes of a port's message. While this exists, the array can be neither freed nor resized.
pub(crate) struct Memory {
    buffer: PyBuffer<u8>,
    size: usize,
}

impl Memory {
    /// The first `size` bytes of `array`.
    ///
    /// # Errors
    /// When it has fewer, is not writable, or is not contiguous.
    pub(crate) fn of(array: &Bound<'_, PyAny>, size: usize) -> PyResult<Memory> {
        let buffer = PyBuffer::<u8>::get(array)?;
        if buffer.readonly() || !buffer.is_c_contiguous() || buffer.len_bytes() < size {
            return Err(PyValueError::new_err(
                "the memory of a port was replaced by another array",
            ));
        }
        Ok(Memory { buffer, size })
    }

    /// The whole of an array of `count` doubles.
    ///
    /// # Errors
    /// When it has another element type, or another number of elements.
    pub(crate) fn of_doubles(array: &Bound<'_, PyAny>, count: usize) -> PyResult<Memory> {
        if PyBuffer::<f64>::get(array)?.item_count() != count {
            return Err(PyValueError::new_err(format!("an array of {count} doubles is needed")));
        }
        Memory::of(&array.call_method1("view", ("u1",))?, 8 * count)
    }

    fn at(&self) -> *mut u8 {
        self.buffer.buf_ptr().cast()
    }

    /// Copies `bytes` into the memory. The interpreter lock is held: there is no other writer.
    pub(crate) fn put(&self, _held: Python<'_>, bytes: &[u8]) {
        let count = self.size.min(bytes.len());
        // SAFETY: the export keeps the memory, which has `size` bytes and is writable; `bytes` is Rust memory and does not overlap it.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), self.at(), count) }
    }

    /// Copies the memory to `bytes`.
    pub(crate) fn take(&self, _held: Python<'_>, bytes: &mut [u8]) {
        let count = self.size.min(bytes.len());
        // SAFETY: as above, in the other direction.
        unsafe { std::ptr::copy_nonoverlapping(self.at().cast_const(), bytes.as_mut_ptr(), count) }
    }
}
