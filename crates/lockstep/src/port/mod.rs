//! Ports: what a participant reads and writes, described so that a consumer does not need the producer's source code.

mod descriptor;
mod element;
mod enumeration;
mod enumeration_macro;
mod message;
mod room;

pub use descriptor::{Descriptor, DescriptorError, Field};
pub use element::Element;
pub use enumeration::{EnumValue, InvalidValue};
pub use message::{__private, FieldType, Message};
pub use room::{Bytes, Content, Text, TooLong};
