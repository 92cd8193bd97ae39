//! Scene of the 3-D playback, independent of any run: bodies that follow fields of the tape, their shapes, cameras.
//!
//! A [`Scene`] comes from the table `[scene]` of a scenario ([`Scene::read`]), or from a program for a specific application
//! ([`crate::view::View::scene`]). Lengths are metres, angles radians, quaternions Hamilton and scalar first; an attitude
//! transforms components in the body's axes into components in the scene's frame.

mod bind;
mod channel;
mod keys;
mod model;
mod read;
mod shape;
#[cfg(test)]
mod tests;
mod types;
mod values;

pub(crate) use bind::{BoundBody, BoundScene, bind};
pub(crate) use channel::{ChannelElement, Motion, write_elements};
pub(crate) use model::Link;
pub use model::{Model, ModelError, Solid, SolidKind};
pub use types::{Arrow, Attitude, Axes, Body, Camera, Component, Distance, Path, Position, Scene, Shape, Towards};
