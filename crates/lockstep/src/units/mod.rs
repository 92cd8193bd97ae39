//! Physical quantities as users write them, checked for their dimension and converted to SI units and radians.
//!
//! A file has `"0.2 deg/s"`, `"10 N m"` or `"[-0.42, 0, -2.85] m"`; a parameter struct states the required quantity by the type of its
//! field, and reads numbers in SI units:
//!
//! ```
//! use lockstep::units::{Angle, AngularRate, Quantity, Vector, read};
//!
//! #[derive(serde::Deserialize)]
//! #[serde(deny_unknown_fields)]
//! struct Start {
//!     heading: Quantity<Angle>,
//!     rate: Vector<AngularRate, 3>,
//! }
//!
//! let table: toml::Table = toml::from_str("heading = '90 deg'\nrate = '[0.3, 0.5, 1.0] deg/s'")?;
//! let start: Start = read(&table).unwrap();
//! assert!((start.heading.si() - 1.5707963267948966).abs() < 1e-15);
//!
//! let table: toml::Table = toml::from_str("heading = 90\nrate = '[0, 0, 0] deg/s'")?;
//! let refused = read::<Start>(&table).err().unwrap();
//! assert_eq!(refused.key, "heading");
//! assert!(refused.reason.contains("30 deg"));
//! # Ok::<(), toml::de::Error>(())
//! ```
//!
//! # How a quantity is written
//!
//! A number or a list of numbers in brackets, then a unit: factors separated by spaces, `*` or `·`, each with an optional power (`m^2`,
//! `m2`, `m²`, `s^-1`); a `/` divides by the one factor that follows it, so `kg m^2/s` and `m/s/s` are read as written. [`known_symbols`]
//! lists the known symbols. A dimensionless number is a plain TOML number and does not need this module.
//!
//! Angles are a dimension of their own where that detects mistakes: `deg` is rejected where no angle belongs, while `rad` may be omitted
//! or added where mechanics conventionally does so (`N m s` or `N m s/rad`).

mod dimension;
mod kinds;
mod parse;
mod quantity;
mod table;

pub use dimension::Dimension;
pub use kinds::*;
pub use parse::{UnitError, convert, known_symbols, parse, unit_factor, unit_in};
pub use quantity::{PerAxis, Quantity, QuantityKind, Vector};
pub use table::read;
