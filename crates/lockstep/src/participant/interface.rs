//! The ports of a participant.

use std::collections::HashSet;

use serde::{Deserialize, Serialize};

use crate::name::{NAME_MAX, is_name};
use crate::port::{Descriptor, DescriptorError, Message};

/// How a participant's outputs depend on its inputs in time.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Kind {
    /// Computes at t_k from the inputs at t_k; the outputs are stamped t_k (direct feedthrough).
    Sampled,
    /// Holds the inputs at t_k over [t_k, t_k + P] and integrates; the outputs are stamped t_k + P (no feedthrough).
    /// Its outputs at the first instant exist before the run starts.
    Continuous,
}

/// An input port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Input {
    /// The port's name.
    pub name: String,
    /// The payload it accepts.
    pub descriptor: Descriptor,
    /// Whether the scenario must connect it. An input that is not connected holds zeros.
    pub required: bool,
}

/// An output port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Output {
    /// The port's name.
    pub name: String,
    /// The payload it delivers.
    pub descriptor: Descriptor,
}

/// What a participant reports about itself in the handshake.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Interface {
    /// How outputs depend on inputs.
    pub kind: Kind,
    /// The input ports; their position is their number in [`super::Inputs`].
    pub inputs: Vec<Input>,
    /// The output ports; their position is their number in [`super::Outputs`].
    pub outputs: Vec<Output>,
}

/// The most ports of one direction that a participant may have.
pub(super) const PORTS_MAX: usize = 256;

impl Interface {
    /// An interface without ports.
    pub fn new(kind: Kind) -> Interface {
        Interface {
            kind,
            inputs: Vec::new(),
            outputs: Vec::new(),
        }
    }

    /// Adds an input that the scenario must connect.
    pub fn input<M: Message>(mut self, name: &str) -> Interface {
        self.inputs.push(Input {
            name: name.to_owned(),
            descriptor: M::descriptor(),
            required: true,
        });
        self
    }

    /// Adds an input that may stay unconnected and then holds zeros.
    pub fn optional_input<M: Message>(mut self, name: &str) -> Interface {
        self.inputs.push(Input {
            name: name.to_owned(),
            descriptor: M::descriptor(),
            required: false,
        });
        self
    }

    /// Adds an output.
    pub fn output<M: Message>(mut self, name: &str) -> Interface {
        self.outputs.push(Output {
            name: name.to_owned(),
            descriptor: M::descriptor(),
        });
        self
    }

    /// Checks the interface that a foreign participant reports.
    pub fn validate(&self) -> Result<(), InterfaceError> {
        let inputs = self.inputs.iter().map(|port| (&port.name, &port.descriptor));
        let outputs = self.outputs.iter().map(|port| (&port.name, &port.descriptor));
        for ports in [inputs.collect::<Vec<_>>(), outputs.collect()] {
            if ports.len() > PORTS_MAX {
                return Err(InterfaceError::TooMany(ports.len()));
            }
            let mut names = HashSet::new();
            for (name, descriptor) in &ports {
                if !is_name(name, NAME_MAX) {
                    return Err(InterfaceError::Name((*name).clone()));
                }
                if !names.insert(*name) {
                    return Err(InterfaceError::Twice((*name).clone()));
                }
                descriptor.validate().map_err(|source| InterfaceError::Descriptor {
                    port: (*name).clone(),
                    source,
                })?;
            }
        }
        Ok(())
    }

    /// Describes the first difference to `expected`, the interface that the plan requires of this participant. Which inputs must be
    /// connected does not count as a difference.
    pub fn difference(&self, expected: &Interface) -> Option<String> {
        if self.kind != expected.kind {
            return Some(format!("it is {:?} where {:?} is expected", self.kind, expected.kind));
        }
        let mine = self.inputs.iter().map(|port| ("input", &port.name, &port.descriptor));
        let mine: Vec<_> = mine
            .chain(self.outputs.iter().map(|port| ("output", &port.name, &port.descriptor)))
            .collect();
        let theirs = expected
            .inputs
            .iter()
            .map(|port| ("input", &port.name, &port.descriptor));
        let theirs: Vec<_> = theirs
            .chain(
                expected
                    .outputs
                    .iter()
                    .map(|port| ("output", &port.name, &port.descriptor)),
            )
            .collect();
        for (direction, name, descriptor) in &theirs {
            match mine.iter().find(|port| port.0 == *direction && port.1 == *name) {
                None => return Some(format!("it has no {direction} `{name}`")),
                Some((.., own)) => {
                    if let Some(difference) = own.difference(descriptor) {
                        return Some(format!("{direction} `{name}`: {difference}"));
                    }
                }
            }
        }
        let extra = mine
            .iter()
            .find(|port| !theirs.iter().any(|other| other.0 == port.0 && other.1 == port.1));
        extra
            .map(|(direction, name, _)| format!("it has the {direction} `{name}`, which is not expected"))
            .or_else(|| (mine != theirs).then(|| "its ports are in a different order".to_owned()))
    }
}

/// Why an interface cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum InterfaceError {
    /// More ports than allowed.
    #[error("{0} ports in one direction; at most {PORTS_MAX} are allowed")]
    TooMany(usize),
    /// A name that is not allowed in a scenario or a file name.
    #[error("`{0}` is not a port name: use up to 64 letters, digits, `_` and `-`")]
    Name(String),
    /// A name used twice in one direction.
    #[error("the port `{0}` is declared twice")]
    Twice(String),
    /// A payload that cannot be used.
    #[error("port `{port}`: {source}")]
    Descriptor {
        /// The port.
        port: String,
        /// What is wrong with its payload.
        source: DescriptorError,
    },
}
