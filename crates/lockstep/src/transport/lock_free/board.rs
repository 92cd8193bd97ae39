//! A blackboard value: one process sets it and others read it at any time.

/// The writing end.
pub(crate) trait Set<T> {
    /// Sets the value. A process that reads it sees everything that was written before.
    fn set(&self, value: T);
}

/// The reading end.
pub(crate) trait Get<T> {
    /// The newest value that has arrived here.
    fn get(&self) -> T;
}
