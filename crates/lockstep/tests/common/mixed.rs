//! The message between the participants of random plans, and random times.

use lockstep::time::Rational;
use proptest::prelude::*;

lockstep::message! {
    /// A value that depends on all earlier ones.
    pub struct Mixed {
        /// A hash of all inputs so far.
        pub hash: u64 = "1",
        /// The same as a number.
        pub x: f64 = "m",
    }
}

pub fn time(range: std::ops::Range<i128>) -> impl Strategy<Value = Rational> {
    // Odd denominators: thirds and sevenths of milliseconds are as good as any other time.
    (range, prop_oneof![Just(1_i128), Just(2), Just(3), Just(7)]).prop_map(|(n, d)| Rational::new(n, d * 1000).unwrap())
}
