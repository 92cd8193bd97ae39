//! Exports of a tape, figures, and the report page.
//!
//! - [`campaign`]: the page of a campaign;
//! - [`export`]: CSV, Parquet, MCAP and MAT;
//! - [`figures`]: charts and maps as SVG and PNG;
//! - [`page`]: figures and 3-D playback in one HTML page;
//! - [`scene`]: the contents of a playback;
//! - [`view`]: the figures of a page.
//!
//! The crate knows ports only by their [`lockstep::port::Descriptor`]: every field has a name, a shape, a unit and a frame;
//! the crate never needs the type that produced it.
//!
//! # Example
//!
//! ```
//! use report::figures::{Chart, Curve, svg};
//!
//! let chart = Chart {
//!     title: "A tank that runs empty".into(),
//!     x_label: "t [s]".into(),
//!     y_label: "depth [m]".into(),
//!     curves: vec![Curve {
//!         name: "depth".into(),
//!         points: vec![[0.0, 0.4], [1.0, 0.3], [2.0, 0.2]],
//!         ..Curve::default()
//!     }],
//!     ..Chart::default()
//! };
//! assert!(svg(&chart.drawing()).starts_with("<svg"));
//! ```

pub mod campaign;
pub mod export;
pub mod figures;
mod markup;
pub mod page;
pub mod scene;
pub mod view;
