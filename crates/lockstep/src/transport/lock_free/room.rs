//! The free room in a ring, as its writer knows it.

use super::board::Get;
use crate::transport::interface::TransportError;

/// The reader's progress when it was last read.
#[derive(Debug, Default)]
pub(crate) struct Room {
    taken: u64,
}

impl Room {
    /// Whether a ring of size `size`, into which `written` have been written in total, has room for `more`. `count` is the reader's
    /// progress; it is read only when there would be no room otherwise.
    #[inline]
    pub(crate) fn fits(
        &mut self,
        size: u64,
        written: u64,
        more: u64,
        count: &impl Get<u64>,
    ) -> Result<bool, TransportError> {
        let fits = |taken| written + more - taken <= size;
        if !fits(self.taken) {
            self.taken = read_progress(count, self.taken, written)?;
        }
        Ok(fits(self.taken))
    }
}

/// The reader's progress, which was `before` at the last call; `written` is the total written, which it cannot exceed.
pub(crate) fn read_progress(count: &impl Get<u64>, before: u64, written: u64) -> Result<u64, TransportError> {
    let taken = count.get();
    if (before..=written).contains(&taken) {
        return Ok(taken);
    }
    Err(TransportError(format!(
        "its reader reports that it took {taken} of {written}, after {before}"
    )))
}
