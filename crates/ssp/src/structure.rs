//! A system structure: systems, components, and their connections.

use std::collections::BTreeMap;
use std::rc::Rc;

use fmu::Unit;

use crate::error::Problem;
use crate::transform::Transformation;
use crate::values::ParameterValue;

/// The description of a package. Elements are numbered; the first is the root system.
#[derive(Debug)]
pub struct Structure {
    /// The files inside the package: the description, and those of other systems that it refers to.
    pub files: Vec<Rc<str>>,
    /// The FMUs of nested packages, by their sources.
    pub inside: BTreeMap<String, Vec<u8>>,
    /// Its name.
    pub name: String,
    /// Start of the default experiment, s.
    pub start: Option<f64>,
    /// Its end, s.
    pub stop: Option<f64>,
    /// Systems and components.
    pub elements: Vec<Element>,
}

/// A line of one of the files.
#[derive(Debug, Clone, Copy)]
pub struct Location {
    /// The file's number.
    pub file: usize,
    /// The line, from 1.
    pub line: u32,
}

/// A system or a component.
#[derive(Debug)]
pub struct Element {
    /// Its name in its system.
    pub name: String,
    /// The system that contains it; none for the root.
    pub parent: Option<usize>,
    /// Its connectors.
    pub connectors: Vec<Connector>,
    /// Values of parameters, later ones before earlier ones.
    pub bindings: Vec<BoundValue>,
    /// Its kind.
    pub content: Content,
    /// The line.
    pub line: Location,
}

/// The kind of an element.
#[derive(Debug)]
pub enum Content {
    /// A system with its connections.
    System(Vec<Connection>),
    /// A component, with the entry of the archive that contains its FMU.
    Component(String),
    /// A reference to the signal dictionary of this number: a value that enters a connector of one reference leaves by the connectors of
    /// that name of all references.
    DictionaryReference(usize),
}

/// A connector of an element.
#[derive(Debug)]
pub struct Connector {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: ConnectorKind,
    /// Its unit, if stated.
    pub unit: Option<Unit>,
    /// The line.
    pub line: Location,
}

/// The kind of a connector.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ConnectorKind {
    /// A value that enters the element before the run starts.
    Parameter,
    /// A value that enters the element.
    Input,
    /// A value that leaves the element.
    Output,
    /// Not stated.
    Open,
}

/// An end of a connection: an element of the system, or none for the system itself, and a connector.
pub type ConnectionEnd = (Option<usize>, String);

/// A connection of a system. The kinds of the connectors determine which end is the source.
#[derive(Debug)]
pub struct Connection {
    /// One end.
    pub start: ConnectionEnd,
    /// The other end.
    pub end: ConnectionEnd,
    /// Whether unit conversion is suppressed.
    pub suppress: bool,
    /// The transformation of the value.
    pub transformation: Transformation,
    /// The line.
    pub line: Location,
}

/// A value for a parameter of an element, or of one inside it.
#[derive(Debug, Clone)]
pub struct BoundValue {
    /// The parameter's name relative to the element: `P`, or `inner.P`.
    pub target: String,
    /// The value.
    pub given: Rc<ParameterValue>,
    /// Whether unit conversion is suppressed.
    pub suppress: bool,
    /// The transformation of the value.
    pub transformation: Transformation,
}

impl Element {
    /// The connector called `name`.
    pub fn connector(&self, name: &str) -> Option<&Connector> {
        self.connectors.iter().find(|one| one.name == name)
    }

    /// The source of the FMU, if the element is a component.
    pub fn source(&self) -> Option<&str> {
        match &self.content {
            Content::Component(source) => Some(source),
            Content::System(_) | Content::DictionaryReference(_) => None,
        }
    }
}

impl Structure {
    /// The name of an element relative to the root: `inner.gain`; empty for the root itself.
    pub fn path(&self, element: usize) -> String {
        let own = &self.elements[element];
        match own.parent.map(|parent| self.path(parent)) {
            None => String::new(),
            Some(above) if above.is_empty() => own.name.clone(),
            Some(above) => format!("{above}.{}", own.name),
        }
    }

    /// A connector with its element, for messages.
    pub fn connector_path(&self, element: usize, connector: &str) -> String {
        let path = self.path(element);
        if path.is_empty() {
            connector.to_owned()
        } else {
            format!("{path}.{connector}")
        }
    }

    /// A problem in a description.
    pub fn problem(&self, place: Location, reason: String) -> Problem {
        Problem {
            file: self.files[place.file].to_string(),
            line: place.line,
            reason,
        }
    }
}
