//! Room in a ring, as its writer knows it.

use super::board::Get;
use crate::transport::interface::Broken;

/// How much the reader had taken when that was last looked at.
#[derive(Debug, Default)]
pub(crate) struct Room {
    taken: u64,
}

impl Room {
    /// Whether a ring of `size`, into which `written` were ever written, has room for `more`. What the reader has taken stands in `count`;
    /// it is looked at only when there would be no room otherwise.
    #[inline]
    pub(crate) fn fits(&mut self, size: u64, written: u64, more: u64, count: &impl Get<u64>) -> Result<bool, Broken> {
        let fits = |taken| written + more - taken <= size;
        if !fits(self.taken) {
            self.taken = taken(count, self.taken, written)?;
        }
        Ok(fits(self.taken))
    }
}

/// What the reader has counted, which was `before` when it was last asked for; `written` is there to be counted.
pub(crate) fn taken(count: &impl Get<u64>, before: u64, written: u64) -> Result<u64, Broken> {
    let taken = count.get();
    if (before..=written).contains(&taken) {
        return Ok(taken);
    }
    Err(Broken(format!(
        "its reader says that it took {taken} of {written}, after {before}"
    )))
}
