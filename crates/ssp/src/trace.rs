//! Tracing of the value of a connector to its source, through the connectors of nested systems.

use std::collections::HashMap;

use fmu::Unit;

use crate::error::Problem;
use crate::structure::{Connection, ConnectionEnd, ConnectorKind, Content, Structure};

/// A connection on the path of a value, with the connector that the value enters by it.
#[derive(Clone, Copy)]
pub struct Step<'a> {
    /// The connection.
    pub connection: &'a Connection,
    /// The element whose connector receives the value, and its connector.
    pub target: (usize, &'a str),
}

/// The source of a value, and the path from there.
pub struct Trace<'a> {
    /// The element and its connector: of the component that computes the value, or of an element with an unconnected one.
    pub origin: (usize, &'a str),
    /// Connections in the order in which the value passes them.
    pub steps: Vec<Step<'a>>,
}

/// The connections of all systems, indexed by the end that they feed.
pub struct Network<'a> {
    structure: &'a Structure,
    /// By system and receiving end: the connection, its source end and its receiving end.
    feeds: HashMap<(usize, ConnectionEnd), (&'a Connection, &'a ConnectionEnd, &'a ConnectionEnd)>,
    /// By signal dictionary and name: the reference that the value enters.
    shared: HashMap<(usize, &'a str), usize>,
    count: usize,
}

impl<'a> Network<'a> {
    /// Determines the source end of each connection.
    ///
    /// # Errors
    /// Connections without a direction, and connectors that are fed twice.
    pub fn new(structure: &'a Structure) -> (Network<'a>, Vec<Problem>) {
        let mut network = Network {
            structure,
            feeds: HashMap::new(),
            shared: HashMap::new(),
            count: 0,
        };
        let mut problems = Vec::new();
        for (system, element) in structure.elements.iter().enumerate() {
            let Content::System(connections) = &element.content else {
                continue;
            };
            for connection in connections {
                network.count += 1;
                let ends = (&connection.start, &connection.end);
                let gives = (network.is_source(system, ends.0), network.is_source(system, ends.1));
                let shown = |end: &ConnectionEnd| structure.connector_path(end.0.unwrap_or(system), &end.1);
                let (source, target) = match gives {
                    (Some(true), Some(false)) | (Some(true), None) | (None, Some(false)) => ends,
                    (Some(false), Some(true)) | (None, Some(true)) | (Some(false), None) => (ends.1, ends.0),
                    _ => {
                        let reason = format!(
                            "the kinds of `{}` and `{}` do not say which of them gives the value: one must be an output (or an input of the \
                             system itself), the other one an input",
                            shown(ends.0),
                            shown(ends.1)
                        );
                        problems.push(structure.problem(connection.line, reason));
                        continue;
                    }
                };
                let feed = (connection, source, target);
                let twice = network.mark_dictionary_source(target);
                if network.feeds.insert((system, target.clone()), feed).is_some() || twice {
                    let reason = format!("`{}` is fed by two connections", shown(target));
                    problems.push(structure.problem(connection.line, reason));
                }
            }
        }
        (network, problems)
    }

    /// Records that a value enters a reference to a signal dictionary; returns whether another one already does.
    fn mark_dictionary_source(&mut self, target: &'a ConnectionEnd) -> bool {
        let Some(reference) = target.0 else { return false };
        let Content::DictionaryReference(dictionary) = self.structure.elements[reference].content else {
            return false;
        };
        let before = self.shared.insert((dictionary, &target.1), reference);
        before.is_some_and(|before| before != reference)
    }

    /// Whether an end is a source inside `system`, as an input of the system itself is.
    fn is_source(&self, system: usize, end: &ConnectionEnd) -> Option<bool> {
        let owner = &self.structure.elements[end.0.unwrap_or(system)];
        let out = match owner.connector(&end.1)?.kind {
            ConnectorKind::Output => true,
            ConnectorKind::Input | ConnectorKind::Parameter => false,
            ConnectorKind::Open => return None,
        };
        Some(out == end.0.is_some())
    }

    /// The source of the connector `name` of `element`: outside a component or system, inside the root.
    ///
    /// # Errors
    /// Connections in a circle without a component.
    pub fn trace(&self, element: usize, name: &'a str) -> Result<Trace<'a>, Problem> {
        let structure = self.structure;
        let mut steps = Vec::new();
        // The connector, and whether it is seen from inside its own system.
        let mut at = (element, name, structure.elements[element].parent.is_none());
        loop {
            let (owner, name, inside) = at;
            let system = if inside {
                Some(owner)
            } else {
                structure.elements[owner].parent
            };
            let end = ((!inside).then_some(owner), name.to_owned());
            let found = system.and_then(|system| Some((system, *self.feeds.get(&(system, end))?)));
            let Some((system, (connection, source, target))) = found else {
                steps.reverse();
                return Ok(Trace {
                    origin: (owner, name),
                    steps,
                });
            };
            if steps.len() > self.count {
                let shown = structure.connector_path(owner, name);
                let reason = format!("the connections that feed `{shown}` go in a circle without a component");
                return Err(structure.problem(connection.line, reason));
            }
            steps.push(Step {
                connection,
                target: (owner, &target.1),
            });
            match source.0 {
                // An output of a component: the source.
                Some(component) if structure.elements[component].source().is_some() => {
                    steps.reverse();
                    return Ok(Trace {
                        origin: (component, &source.1),
                        steps,
                    });
                }
                // An output of a nested system: continue inside. Of a signal dictionary: continue where the value enters it.
                Some(nested) => {
                    at = match structure.elements[nested].content {
                        Content::DictionaryReference(dictionary) => {
                            match self.shared.get(&(dictionary, source.1.as_str())) {
                                Some(reference) => (*reference, source.1.as_str(), false),
                                None => (nested, source.1.as_str(), true),
                            }
                        }
                        _ => (nested, source.1.as_str(), true),
                    }
                }
                // The system's own input: continue outside.
                None => at = (system, &source.1, false),
            }
        }
    }
}

/// The unit of a value after `steps`, each of which may change it.
pub fn unit_after<'a>(before: Option<&'a Unit>, target: Option<&'a Unit>, suppress: bool) -> Option<&'a Unit> {
    match (target, suppress) {
        (Some(unit), _) => Some(unit),
        (None, false) => before,
        (None, true) => None,
    }
}
