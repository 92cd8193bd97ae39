//! Whether two tapes are the same.
