//! Components that are systems from other descriptions and packages.

use fmu::Archive;
use roxmltree::Node;

use super::{DESCRIPTION, DescriptionContext, Reader, read_description};
use crate::error::Problem;
use crate::package::Package;
use crate::structure::{ConnectorKind, Content};

impl<'a> Reader<'a> {
    /// The source of an FMU by its full name. FMUs of nested packages are kept.
    pub(super) fn fmu_source(&mut self, path: String) -> String {
        let full = format!("{}{path}", self.context.prefix);
        if !self.context.prefix.is_empty()
            && !self.found.inside.contains_key(&full)
            && let Some(Ok(contents)) = self.context.package.file(&path)
        {
            self.found.inside.insert(full.clone(), contents);
        }
        full
    }

    /// A component that is a system of another description, or of another package.
    pub(super) fn referenced(
        &mut self,
        node: Node<'a, 'a>,
        parent: usize,
        depth: usize,
        is_package: bool,
    ) -> Result<(), Problem> {
        let own = self.element(node, Some(parent), Content::System(Vec::new()))?;
        let Some(source) = node.attribute("source") else {
            self.refuse(node, "it has no `source`, which names a system");
            return Ok(());
        };
        let Some(entry) = self.entry(node, source) else {
            return Ok(());
        };
        let read = |package: &Package, name: &str| match package.file(name) {
            Some(Ok(bytes)) => Ok(bytes),
            Some(Err(error)) => Err(self.xml.problem(node, format!("`{name}`: {error}"))),
            None => Err(self.xml.problem(node, format!("`{entry}` has no {name}"))),
        };
        let bytes = read(self.context.package, &entry)?;
        let inner;
        let (context, file, bytes) = if is_package {
            let archive = Archive::read(bytes);
            inner = Package::Archive(archive.map_err(|error| self.xml.problem(node, format!("`{entry}`: {error}")))?);
            let bytes = read(&inner, DESCRIPTION)?;
            let context = DescriptionContext {
                package: &inner,
                prefix: format!("{}{entry}!/", self.context.prefix),
                folder: String::new(),
            };
            (context, DESCRIPTION, bytes)
        } else {
            let context = DescriptionContext {
                package: self.context.package,
                prefix: self.context.prefix.clone(),
                folder: entry
                    .rsplit_once('/')
                    .map_or(String::new(), |(folder, _)| format!("{folder}/")),
            };
            (context, entry.as_str(), bytes)
        };
        read_description(&context, file, &bytes, &mut self.found, |reader| {
            reader.inner(own, depth + 1)
        })
    }

    /// The root system as the content of the element `own`, which refers to it. The element's connectors must be those of the system, and
    /// its values take precedence over the system's own.
    fn inner(&mut self, own: usize, depth: usize) -> Result<(), Problem> {
        let system = self.root_system()?;
        let name = self.found.elements[own].name.clone();
        let mut connectors = self.connectors(system, &name)?;
        let mut bindings = self.bindings(system)?;
        let element = &mut self.found.elements[own];
        bindings.append(&mut element.bindings);
        element.bindings = bindings;
        for outer in std::mem::take(&mut element.connectors) {
            let inside = connectors.iter_mut().find(|one| one.name == outer.name);
            let reason = match inside {
                Some(inside) if inside.kind == outer.kind || outer.kind == ConnectorKind::Open => {
                    inside.unit = outer.unit.or(inside.unit.take());
                    continue;
                }
                Some(_) => "has another kind in the system that it names",
                None => "is none of the system that it names",
            };
            self.found.problems.push(Problem {
                file: self.found.files[outer.line.file].to_string(),
                line: outer.line.line,
                reason: format!("the connector `{}` of `{name}` {reason}", outer.name),
            });
        }
        self.found.elements[own].connectors = connectors;
        self.content_of(system, own, depth)
    }
}
