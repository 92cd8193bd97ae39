//! What marks a folder as a tape of this format.

/// The version of the folder's format that this program writes, and the only one it reads.
pub const FORMAT_VERSION: u32 = 1;

/// What marks `index.json` as ours.
pub(crate) const FORMAT_NAME: &str = "escapement-tape";
