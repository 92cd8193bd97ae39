//! Exports of a tape, figures, and the report page.
//!
//! - [`campaign`]: the page of a campaign;
//! - [`export`]: CSV, Parquet and MCAP;
//! - [`figures`]: charts and maps as SVG and PNG;
//! - [`page`]: figures and 3-D playback in one HTML page;
//! - [`scene`]: what a playback shows;
//! - [`view`]: which figures a page draws.
//!
//! The crate knows ports only by their [`lockstep::port::Descriptor`]: every field has a name, a shape, a unit and a
//! frame, and nothing here needs the type that produced it.

pub mod campaign;
pub mod export;
pub mod figures;
mod markup;
pub mod page;
pub mod scene;
pub mod view;
