//! Designs of experiments, distributions, subset simulation, and statistics of the results. Values in, values out.
//!
//! ```
//! use sampling::design::Coordinate;
//! use sampling::distribution::Scalar;
//!
//! // Number 137 of the draws called `mass` of the campaign with seed 1.
//! let draw = Coordinate::random(1, "mass").at(137);
//! let mass = Scalar::Normal { mean: 150.0, deviation: 5.0 }.quantile(draw);
//! assert!((100.0..200.0).contains(&mass));
//! ```
//!
//! A *coordinate* is one axis of the unit cube: it maps the index k of a point to a number in (0, 1), a function of seed, name and k
//! alone. A distribution computes its value from as many coordinates as it needs, by inverse distribution functions, so any design
//! serves any distribution.

pub mod design;
pub mod distribution;
pub mod statistics;
pub mod subset;
