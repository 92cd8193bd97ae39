//! A value that one process sets and others read at any time.

/// The end of the one who sets it.
pub(crate) trait Set<T> {
    /// Sets the value. Who gets it sees everything that was done before.
    fn set(&self, value: T);
}

/// The end of one who reads it.
pub(crate) trait Get<T> {
    /// The newest value that has arrived here.
    fn get(&self) -> T;
}
