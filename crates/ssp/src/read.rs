//! The reader of `SystemStructure.ssd` and of the files that it refers to.

mod reference;

use std::collections::BTreeMap;
use std::rc::Rc;

use roxmltree::Node;

use crate::error::Problem;
use crate::package::Package;
use crate::structure::{
    BoundValue, Connection, ConnectionEnd, Connector, ConnectorKind, Content, Element, Location, Structure,
};
use crate::transform::Transformation;
use crate::values::ParameterValue;
use crate::xml::{Xml, child, children, elements, parse};
use crate::{mapping, values};

/// The description that every package has.
pub const DESCRIPTION: &str = "SystemStructure.ssd";
/// The deepest nesting of systems.
const DEPTH_MAX: usize = 64;
/// The most elements of one structure.
const ELEMENTS_MAX: usize = 10_000;

/// Everything read so far, from the description and from those that it refers to.
#[derive(Default)]
struct ReadElements {
    files: Vec<Rc<str>>,
    elements: Vec<Element>,
    inside: BTreeMap<String, Vec<u8>>,
    /// Signal dictionaries by the system that contains them and their names.
    dictionaries: Vec<(usize, String)>,
    problems: Vec<Problem>,
}

/// The location of a description.
struct DescriptionContext<'a> {
    package: &'a Package,
    /// The prefix of its files' names: `inner.ssp!/` for a package inside the package.
    prefix: String,
    /// The folder inside the package to which sources are relative, with a slash at its end; empty for the root.
    folder: String,
}

/// A reader of one description.
struct Reader<'a> {
    xml: Xml<'a>,
    root: Node<'a, 'a>,
    context: &'a DescriptionContext<'a>,
    /// The number of its file.
    file: usize,
    found: ReadElements,
}

/// Reads the description of `package`, which is `bytes`.
///
/// # Errors
/// All problems: what is wrong with it or cannot be expressed.
pub fn read(package: &Package, bytes: &[u8]) -> Result<Structure, Vec<Problem>> {
    let context = DescriptionContext {
        package,
        prefix: String::new(),
        folder: String::new(),
    };
    let mut found = ReadElements::default();
    let structure = read_description(&context, DESCRIPTION, bytes, &mut found, |reader| reader.structure());
    match structure {
        Ok(structure) if found.problems.is_empty() => Ok(Structure {
            files: found.files,
            inside: found.inside,
            elements: found.elements,
            ..structure
        }),
        Ok(_) => Err(found.problems),
        Err(problem) => {
            found.problems.push(problem);
            Err(found.problems)
        }
    }
}

/// Reads the description `file`, whose content is `bytes`; appends its elements to those read before.
fn read_description<T>(
    context: &DescriptionContext<'_>,
    file: &str,
    bytes: &[u8],
    found: &mut ReadElements,
    work: impl FnOnce(&mut Reader<'_>) -> Result<T, Problem>,
) -> Result<T, Problem> {
    let name = format!("{}{file}", context.prefix);
    parse(&name, bytes, |xml, root| {
        found.files.push(name.as_str().into());
        // The node and its document live as long as this call.
        let mut reader = Reader {
            xml,
            root,
            context,
            file: found.files.len() - 1,
            found: std::mem::take(found),
        };
        let done = work(&mut reader);
        *found = reader.found;
        done
    })
}

impl<'a> Reader<'a> {
    /// Reads the root system of a document whose version is known.
    fn root_system(&self) -> Result<Node<'a, 'a>, Problem> {
        let (xml, root) = (self.xml, self.root);
        xml.root(root, "SystemStructureDescription")?;
        let version = xml.required_attribute(root, "version")?;
        if !(version.starts_with("1.") || version.starts_with("2.")) {
            return Err(xml.problem(root, format!("SSP version `{version}`; 1.0 and 2.0 are supported")));
        }
        child(root, "System").ok_or_else(|| xml.problem(root, "it has no `System`"))
    }

    /// The remaining fields of an element, without the problems found.
    fn structure(&mut self) -> Result<Structure, Problem> {
        let system = self.root_system()?;
        let (xml, root) = (self.xml, self.root);
        let name = xml.required_attribute(root, "name")?;
        let (mut start, mut stop) = (None, None);
        if let Some(experiment) = child(root, "DefaultExperiment") {
            start = xml.number(experiment, "startTime")?;
            stop = xml.number(experiment, "stopTime")?;
        }
        self.system(system, None, 0)?;
        Ok(Structure {
            name,
            start,
            stop,
            files: Vec::new(),
            inside: BTreeMap::new(),
            elements: Vec::new(),
        })
    }

    fn location(&self, node: Node<'_, '_>) -> Location {
        Location {
            file: self.file,
            line: self.xml.line(node),
        }
    }

    fn refuse(&mut self, node: Node<'_, '_>, reason: impl Into<String>) {
        let problem = self.xml.problem(node, reason);
        self.found.problems.push(problem);
    }

    /// Reads what systems and components have in common.
    fn element(&mut self, node: Node<'a, 'a>, parent: Option<usize>, content: Content) -> Result<usize, Problem> {
        let xml = self.xml;
        // The name of the root may be missing: nothing refers to it.
        let name = match parent {
            None => node.attribute("name").unwrap_or_default().to_owned(),
            Some(_) => xml.required_attribute(node, "name")?,
        };
        if self.found.elements.len() >= ELEMENTS_MAX {
            return Err(xml.problem(node, format!("there are more than {ELEMENTS_MAX} elements")));
        }
        if self
            .found
            .elements
            .iter()
            .any(|one| one.parent == parent && one.name == name)
        {
            self.refuse(node, format!("two elements of a system are called `{name}`"));
        }
        let connectors = self.connectors(node, &name)?;
        let bindings = self.bindings(node)?;
        self.found.elements.push(Element {
            name,
            parent,
            connectors,
            bindings,
            content,
            line: self.location(node),
        });
        Ok(self.found.elements.len() - 1)
    }

    fn connectors(&mut self, node: Node<'a, 'a>, name: &str) -> Result<Vec<Connector>, Problem> {
        let mut connectors: Vec<Connector> = Vec::new();
        for own in children(node, "Connectors").flat_map(elements) {
            let connector = self.connector(own)?;
            if connectors.iter().any(|one| one.name == connector.name) {
                self.refuse(
                    own,
                    format!("two connectors of `{name}` are called `{}`", connector.name),
                );
            }
            connectors.push(connector);
        }
        Ok(connectors)
    }

    fn bindings(&mut self, node: Node<'a, 'a>) -> Result<Vec<BoundValue>, Problem> {
        let mut bindings = Vec::new();
        for binding in children(node, "ParameterBindings").flat_map(elements) {
            bindings.extend(self.binding(binding)?);
        }
        Ok(bindings)
    }

    fn connector(&mut self, node: Node<'a, 'a>) -> Result<Connector, Problem> {
        let xml = self.xml;
        let name = xml.required_attribute(node, "name")?;
        let kind = match xml.required_attribute(node, "kind")?.as_str() {
            "input" => ConnectorKind::Input,
            "parameter" | "structuralParameter" => ConnectorKind::Parameter,
            "output" | "local" | "calculatedParameter" | "constant" => ConnectorKind::Output,
            "inout" | "unspecified" => ConnectorKind::Open,
            other => return Err(xml.problem(node, format!("the connector `{name}` has the unknown kind `{other}`"))),
        };
        let of_type = elements(node).find(|one| one.attribute("unit").is_some());
        Ok(Connector {
            unit: of_type.map_or(Ok(None), |own| xml.unit(self.root, own))?,
            name,
            kind,
            line: self.location(node),
        })
    }

    fn system(&mut self, node: Node<'a, 'a>, parent: Option<usize>, depth: usize) -> Result<(), Problem> {
        let own = self.element(node, parent, Content::System(Vec::new()))?;
        self.content_of(node, own, depth)
    }

    /// Reads the content of the system `own`.
    fn content_of(&mut self, node: Node<'a, 'a>, own: usize, depth: usize) -> Result<(), Problem> {
        if depth > DEPTH_MAX {
            return Err(self
                .xml
                .problem(node, format!("systems are nested more than {DEPTH_MAX} deep")));
        }
        for dictionary in children(node, "SignalDictionaries").flat_map(elements) {
            let name = self.xml.required_attribute(dictionary, "name")?;
            self.found.dictionaries.push((own, name));
        }
        for inner in children(node, "Elements").flat_map(elements) {
            match inner.tag_name().name() {
                "System" => self.system(inner, Some(own), depth + 1)?,
                "Component" => self.component(inner, own, depth)?,
                "SignalDictionaryReference" => self.dictionary_reference(inner, own)?,
                other => {
                    let reason = format!(
                        "`{other}` is not supported: the elements of a system are components, systems and references to signal dictionaries"
                    );
                    self.refuse(inner, reason);
                }
            }
        }
        let mut connections = Vec::new();
        for inner in children(node, "Connections").flat_map(elements) {
            connections.extend(self.connection(inner, own)?);
        }
        self.found.elements[own].content = Content::System(connections);
        Ok(())
    }

    /// A reference to a signal dictionary of this system or of an enclosing one.
    fn dictionary_reference(&mut self, node: Node<'a, 'a>, parent: usize) -> Result<(), Problem> {
        let name = self.xml.required_attribute(node, "dictionary")?;
        let mut around = Some(parent);
        while let Some(system) = around {
            let mut all = self.found.dictionaries.iter();
            if let Some(number) = all.position(|(owner, own)| *owner == system && *own == name) {
                return self
                    .element(node, Some(parent), Content::DictionaryReference(number))
                    .map(|_| ());
            }
            around = self.found.elements[system].parent;
        }
        let reason = format!("there is no signal dictionary `{name}` in this system or in one around it");
        self.refuse(node, reason);
        Ok(())
    }

    fn component(&mut self, node: Node<'a, 'a>, parent: usize, depth: usize) -> Result<(), Problem> {
        const FMU: &str = "application/x-fmu-sharedlibrary";
        let name = node.attribute("name").unwrap_or_default();
        let kind = node.attribute("type").unwrap_or(FMU);
        match kind {
            FMU => {}
            "application/x-ssp-definition" => return self.referenced(node, parent, depth, false),
            "application/x-ssp-package" => return self.referenced(node, parent, depth, true),
            _ => self.refuse(
                node,
                format!("the component `{name}` is a `{kind}`; only FMUs (`{FMU}`) and systems can take part"),
            ),
        }
        let implementation = node.attribute("implementation").unwrap_or("any");
        if !matches!(implementation, "any" | "CoSimulation") {
            let reason =
                format!("the component `{name}` is wanted as {implementation}; only co-simulation can take part");
            self.refuse(node, reason);
        }
        let source = match node.attribute("source") {
            Some(source) => self.entry(node, source),
            None => {
                self.refuse(
                    node,
                    format!("the component `{name}` has no `source`: it is an architecture without an FMU"),
                );
                None
            }
        };
        let source = source.map(|path| self.fmu_source(path)).unwrap_or_default();
        self.element(node, Some(parent), Content::Component(source))?;
        Ok(())
    }

    /// The entry of the archive that a URI names.
    fn entry(&mut self, node: Node<'a, 'a>, uri: &str) -> Option<String> {
        let own = decoded(uri);
        let own = own.strip_prefix("./").unwrap_or(&own);
        let outside = own.contains("://") || own.starts_with('/') || own.split('/').any(|part| part == "..");
        let path = format!("{}{own}", self.context.folder);
        if outside || own.contains('#') || own.starts_with("file:") || node.attribute("sourceBase") == Some("component")
        {
            let reason =
                format!("the source `{uri}` is not supported: name a file of the package, such as `resources/a.fmu`");
            self.refuse(node, reason);
            return None;
        }
        if !self.context.package.has(&path) {
            self.refuse(node, format!("the source `{uri}` is not in the package"));
            return None;
        }
        Some(path)
    }

    fn connection(&mut self, node: Node<'a, 'a>, system: usize) -> Result<Option<Connection>, Problem> {
        let xml = self.xml;
        for indices in ["startIndices", "endIndices"] {
            if node.attribute(indices).is_some() {
                let reason =
                    format!("`{indices}`: single elements of arrays cannot be connected; connect whole connectors");
                self.refuse(node, reason);
            }
        }
        let start = self.connection_end(node, system, "startElement", "startConnector")?;
        let end = self.connection_end(node, system, "endElement", "endConnector")?;
        let (suppress, transformation) = (
            xml.flag(node, "suppressUnitConversion")?,
            Transformation::read(xml, node)?,
        );
        let line = self.location(node);
        Ok(start.zip(end).map(|(start, end)| Connection {
            start,
            end,
            suppress,
            transformation,
            line,
        }))
    }

    fn connection_end(
        &mut self,
        node: Node<'a, 'a>,
        system: usize,
        element: &str,
        connector: &str,
    ) -> Result<Option<ConnectionEnd>, Problem> {
        let connector = self.xml.required_attribute(node, connector)?;
        let found = match node.attribute(element) {
            None => None,
            Some(name) => {
                let found = self
                    .found
                    .elements
                    .iter()
                    .position(|one| one.parent == Some(system) && one.name == name);
                if found.is_none() {
                    let own = self.found.elements.iter().filter(|one| one.parent == Some(system));
                    let known: Vec<String> = own.map(|one| format!("`{}`", one.name)).collect();
                    let reason = format!(
                        "`{element}`: there is no element `{name}`; there is {}",
                        known.join(", ")
                    );
                    self.refuse(node, reason);
                    return Ok(None);
                }
                found
            }
        };
        let owner = &self.found.elements[found.unwrap_or(system)];
        if owner.connector(&connector).is_none() {
            let known = fmu::nearest(&connector, owner.connectors.iter().map(|one| one.name.as_str()));
            let known = known.map_or(String::new(), |name| format!("; did you mean `{name}`?"));
            let reason = format!("`{}` has no connector `{connector}`{known}", owner.name);
            self.refuse(node, reason);
            return Ok(None);
        }
        Ok(Some((found, connector)))
    }

    fn binding(&mut self, node: Node<'a, 'a>) -> Result<Vec<BoundValue>, Problem> {
        const SET: &str = "application/x-ssp-parameter-set";
        let kind = node.attribute("type").unwrap_or(SET);
        if kind != SET {
            self.refuse(
                node,
                format!("parameters of the type `{kind}` are not supported; `{SET}` is"),
            );
            return Ok(Vec::new());
        }
        let prefix = node.attribute("prefix").unwrap_or_default();
        let given = self.content(node, "ParameterValues", values::read)?;
        let map = match child(node, "ParameterMapping") {
            None => None,
            Some(own) => Some(self.content(own, "", mapping::read)?),
        };
        let given: Vec<Rc<ParameterValue>> = given.unwrap_or_default().into_iter().map(Rc::new).collect();
        let named = given.into_iter().map(|one| (format!("{prefix}{}", one.name), one));
        let Some(map) = map.map(Option::unwrap_or_default) else {
            let bound = named.map(|(target, given)| BoundValue {
                target,
                given,
                suppress: false,
                transformation: Transformation::none(),
            });
            return Ok(bound.collect());
        };
        let mut bound = Vec::new();
        for (name, given) in named {
            bound.extend(map.iter().filter(|entry| entry.source == name).map(|entry| BoundValue {
                target: entry.target.clone(),
                given: Rc::clone(&given),
                suppress: entry.suppress,
                transformation: entry.transformation.clone(),
            }));
        }
        Ok(bound)
    }

    /// Applies `read` to the file that `node` names as its source, or else to the content of its child `wrapper`, or else to `node` itself.
    fn content<T>(
        &mut self,
        node: Node<'a, 'a>,
        wrapper: &'static str,
        read: impl Fn(Xml<'_>, Node<'_, '_>) -> Result<T, Problem>,
    ) -> Result<Option<T>, Problem> {
        if let Some(source) = node.attribute("source") {
            let Some(entry) = self.entry(node, source) else {
                return Ok(None);
            };
            return match self.context.package.file(&entry) {
                Some(Ok(bytes)) => parse(&format!("{}{entry}", self.context.prefix), &bytes, read).map(Some),
                Some(Err(error)) => Err(self.xml.problem(node, error.to_string())),
                None => Ok(None),
            };
        }
        let wrapped = child(node, wrapper).unwrap_or(node);
        match elements(wrapped).find(|one| one.tag_name().name() != "Annotations") {
            Some(root) => read(self.xml, root).map(Some),
            None => {
                let what = node.tag_name().name();
                self.refuse(node, format!("`{what}` has neither a `source` nor a content"));
                Ok(None)
            }
        }
    }
}

/// A URI with its percent-encoding decoded.
fn decoded(uri: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = uri.as_bytes();
    while let [first, after @ ..] = rest {
        let digits = after.get(..2).filter(|_| *first == b'%');
        let code = digits.and_then(|two| std::str::from_utf8(two).ok());
        match code.and_then(|code| u8::from_str_radix(code, 16).ok()) {
            Some(byte) => {
                bytes.push(byte);
                rest = &after[2..];
            }
            None => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}
