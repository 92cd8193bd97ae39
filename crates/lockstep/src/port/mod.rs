//! Ports: what a participant reads and writes, described so that nobody needs the sender's source code.

mod descriptor;
mod message;

pub use descriptor::{Descriptor, DescriptorError, Element, Field};
pub use message::{__private, FieldType, Message};
