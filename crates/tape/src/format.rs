//! The identification of a folder as a tape of this format.

/// The version of the folder's format that this program writes, and the only one it reads.
pub const FORMAT_VERSION: u32 = 1;

/// The format name in `index.json`.
pub(crate) const FORMAT_NAME: &str = "escapement-tape";
