//! The flattened system: connections between variables of FMUs, and the other values that are set.

use fmu::{Causality, Conversion, Description, Model, Unit, Variable, VariableConnection, element};
use toml::Value;

use crate::error::Problem;
use crate::numbers::Scaling;
use crate::parameters::{PathStep, Values, resolve, setting};
use crate::structure::{ConnectorKind, Location, Structure};
use crate::trace::{Network, Step, Trace, unit_after};
use crate::transform::Transformation;

/// The flattened system. Components are numbered in the order of the description.
#[derive(Debug, Default)]
pub struct FlatSystem {
    /// The connections.
    pub connections: Vec<VariableConnection>,
    /// Parameters and start values of each component.
    pub settings: Vec<Vec<(String, Value)>>,
    /// Outputs of the root system that are unchanged values of a component.
    pub outputs: Vec<(String, (usize, String))>,
    /// Notes for the user.
    pub notes: Vec<String>,
    /// Problems that a scenario cannot express.
    pub problems: Vec<Problem>,
}

/// A structure with the FMUs of its components.
pub struct System<'a> {
    structure: &'a Structure,
    /// The number of each element among the components, for elements that are components.
    numbers: Vec<Option<usize>>,
    models: Vec<&'a Model>,
    network: Network<'a>,
    flat: FlatSystem,
    /// The connections between components, from outputs with direct feedthrough.
    feedthrough_edges: Vec<(usize, usize)>,
}

/// Flattens a structure; `components` are the elements that are components, each with its FMU.
pub fn flatten<'a>(structure: &'a Structure, components: &[(usize, &'a Model)]) -> (FlatSystem, Vec<usize>) {
    let (network, problems) = Network::new(structure);
    let mut numbers = vec![None; structure.elements.len()];
    for (number, (element, _)) in components.iter().enumerate() {
        numbers[*element] = Some(number);
    }
    let mut system = System {
        structure,
        numbers,
        models: components.iter().map(|(_, model)| *model).collect(),
        network,
        flat: FlatSystem {
            settings: vec![Vec::new(); components.len()],
            problems,
            ..FlatSystem::default()
        },
        feedthrough_edges: Vec::new(),
    };
    for (element, _) in components {
        system.check_connectors(*element);
    }
    if system.flat.problems.is_empty() {
        system.resolve_all();
    }
    let algebraic_loop = algebraic_loop(components.len(), &system.feedthrough_edges);
    (system.flat, algebraic_loop)
}

impl<'a> System<'a> {
    /// The FMU of an element, and the element's number among the components.
    fn component(&self, element: usize) -> Option<(usize, &'a Description)> {
        let number = self.numbers[element]?;
        let model: &'a Model = self.models[number];
        Some((number, &model.description))
    }

    fn variable(&self, element: usize, name: &str) -> Option<&'a Variable> {
        self.component(element)?.1.variable(name)
    }

    /// The unit of a connector: its own if stated, otherwise that of the FMU's variable.
    fn unit(&self, element: usize, name: &str) -> Option<&'a Unit> {
        let structure: &'a Structure = self.structure;
        let own = structure.elements[element]
            .connector(name)
            .and_then(|one| one.unit.as_ref());
        own.or_else(|| {
            let (_, about) = self.component(element)?;
            about.unit(about.variable(name)?)
        })
    }

    fn refuse(&mut self, line: Location, reason: String) {
        let problem = self.structure.problem(line, reason);
        self.flat.problems.push(problem);
    }

    /// Checks that the connectors of a component match its FMU.
    fn check_connectors(&mut self, element: usize) {
        let structure = self.structure;
        let Some((_, about)) = self.component(element) else {
            return;
        };
        for connector in &structure.elements[element].connectors {
            let shown = structure.connector_path(element, &connector.name);
            let Some(variable) = about.variable(&connector.name) else {
                let known = about.variables.iter().flat_map(Variable::names);
                let mut reason = format!("the FMU has no variable for the connector `{shown}`");
                if let Some(known) = fmu::nearest(&connector.name, known) {
                    reason += &format!("; did you mean `{known}`?");
                }
                self.refuse(connector.line, reason);
                continue;
            };
            let input = variable.causality == Causality::Input;
            let parameter = matches!(
                variable.causality,
                Causality::Parameter | Causality::StructuralParameter
            );
            let agrees = match connector.kind {
                ConnectorKind::Input => input,
                ConnectorKind::Parameter => parameter,
                ConnectorKind::Output => !input && !parameter,
                ConnectorKind::Open => true,
            };
            if !agrees {
                let reason = format!(
                    "the connector `{shown}` has another kind than the variable of the FMU, which is {:?}",
                    variable.causality
                );
                self.refuse(connector.line, reason);
            }
            let theirs = about.unit(variable);
            if let (Some(ours), Some(theirs)) = (&connector.unit, theirs) {
                let mut scaling = Scaling::of(variable.relative);
                let same = scaling.convert(Some(ours), Some(theirs)).is_ok() && (scaling.at(1.0) - 1.0).abs() < 1e-6;
                if !same {
                    let reason = format!(
                        "the connector `{shown}` is in `{}`, and the variable of the FMU in `{}`",
                        ours.name, theirs.name
                    );
                    self.refuse(connector.line, reason);
                }
            }
        }
    }

    /// Processes all inputs and parameters of components, and all outputs of the root.
    fn resolve_all(&mut self) {
        let structure = self.structure;
        let has = |element: usize, name: &str| {
            self.variable(element, name).is_some() || structure.elements[element].connector(name).is_some()
        };
        let (values, unresolved) = resolve(structure, &has);
        for bound in unresolved {
            let given = &bound.given;
            let note = format!(
                "{}:{}: there is no parameter `{}`, so its value is not used",
                given.file, given.line, bound.target
            );
            self.flat.notes.push(note);
        }
        // Bound directly to variables.
        for ((element, name), bound) in &values {
            let Some((variable, (part, about))) = self.variable(*element, name).zip(self.component(*element)) else {
                continue;
            };
            let path = [(bound.suppress, &bound.transformation, self.unit(*element, name))];
            match setting(about, variable, &bound.given, &path) {
                // Two names may mean one variable.
                Ok(_)
                    if self.flat.settings[part]
                        .iter()
                        .any(|(other, _)| *other == variable.name) =>
                {
                    let reason = format!(
                        "`{}` of the FMU has a value already, by another of its names: leave one of them out",
                        variable.name
                    );
                    self.flat.problems.push(bound.given.problem(reason));
                }
                Ok(value) => self.flat.settings[part].push((variable.name.clone(), value)),
                Err(problem) => self.flat.problems.push(problem),
            }
        }
        for (number, element) in structure.elements.iter().enumerate() {
            let Some(part) = self.numbers[number] else {
                continue;
            };
            for connector in element
                .connectors
                .iter()
                .filter(|one| one.kind != ConnectorKind::Output)
            {
                match self.network.trace(number, &connector.name) {
                    Ok(trace) if trace.steps.is_empty() => {}
                    Ok(trace) => {
                        if let Some(value) = self.resolve_connected((number, &connector.name), &trace, &values) {
                            // Values that come through connectors are set by an enclosing element.
                            let own = self.variable(number, &connector.name);
                            let own = own.map_or(&connector.name, |variable| &variable.name);
                            let settings = &mut self.flat.settings[part];
                            settings.retain(|(name, _)| name != own);
                            settings.push((own.clone(), value));
                        }
                    }
                    Err(problem) => self.flat.problems.push(problem),
                }
            }
        }
        self.root_outputs();
    }

    /// An input or parameter that has a connection: it gets a wire, or a constant value.
    fn resolve_connected(&mut self, target: (usize, &'a str), trace: &Trace<'a>, values: &Values<'a>) -> Option<Value> {
        let structure = self.structure;
        let (origin, name) = trace.origin;
        let variable = self.variable(target.0, target.1)?;
        let shown = structure.connector_path(target.0, target.1);
        if structure.elements[origin].source().is_some() {
            let last = trace.steps.last()?;
            if variable.causality != Causality::Input {
                let reason = format!(
                    "`{shown}` is a parameter, which only a value can feed, and not `{}`",
                    structure.connector_path(origin, name)
                );
                self.refuse(last.connection.line, reason);
                return None;
            }
            if let Err(reason) = self.connect(target, variable, trace) {
                let reason = format!(
                    "`{}` does not become `{shown}`: {reason}",
                    structure.connector_path(origin, name)
                );
                self.refuse(last.connection.line, reason);
            }
            return None;
        }
        let Some(bound) = values.get(&(origin, name.to_owned())) else {
            let note = format!(
                "`{}` has no source and no value: `{shown}` keeps its start value",
                structure.connector_path(origin, name)
            );
            self.flat.notes.push(note);
            return None;
        };
        let mut path: Vec<PathStep<'_>> = vec![(bound.suppress, &bound.transformation, self.unit(origin, name))];
        path.extend(trace.steps.iter().map(|step| {
            let unit = self.unit(step.target.0, step.target.1);
            (step.connection.suppress, &step.connection.transformation, unit)
        }));
        match setting(self.component(target.0)?.1, variable, &bound.given, &path) {
            Ok(value) => Some(value),
            Err(problem) => {
                self.flat.problems.push(problem);
                None
            }
        }
    }

    /// The combined effect of all steps of a path on a number.
    fn scaling(&self, trace: &Trace<'a>) -> Result<Scaling, String> {
        let last = trace.steps.last().map(|step| step.target);
        let ends = last.into_iter().chain([trace.origin]);
        let mut variables = ends.filter_map(|(element, name)| self.variable(element, name));
        let mut scaling = Scaling::of(variables.any(|one| one.relative));
        let mut unit = self.unit(trace.origin.0, trace.origin.1);
        for Step { connection, target } in &trace.steps {
            let transformation: &Transformation = &connection.transformation;
            if transformation.maps() {
                return Err(format!(
                    "a {} cannot be done while the system runs: leave it out, or put it into an FMU",
                    transformation.table.unwrap_or_default()
                ));
            }
            let next = self.unit(target.0, target.1);
            if !connection.suppress {
                scaling.convert(unit, next)?;
            }
            scaling.transform(transformation);
            unit = unit_after(unit, next, connection.suppress);
        }
        Ok(scaling)
    }

    fn connect(&mut self, target: (usize, &'a str), input: &Variable, trace: &Trace<'a>) -> Result<(), String> {
        let (origin, name) = trace.origin;
        let fed = |wire: &&VariableConnection| Some(wire.to.0) == self.numbers[target.0] && wire.to.1 == input.name;
        if let Some(wire) = self.flat.connections.iter().find(fed) {
            let name = &wire.to.1;
            return Err(format!(
                "`{name}` of the FMU is fed already, through a connector with another of its names: leave one of the connections out"
            ));
        }
        let ends = self.component(origin).zip(self.component(target.0));
        let ((from, sends), (to, takes)) = ends.ok_or("one of them is no component")?;
        let output = sends.variable(name).ok_or("the FMU has no such variable")?;
        let kinds = (output.kind.name(), input.kind.name());
        let elements = element(sends.version, output).zip(element(takes.version, input));
        let (gives, holds) = elements.ok_or_else(|| format!("{} and {} are no signals", kinds.0, kinds.1))?;
        if !holds.holds(gives) {
            return Err(match holds.room().and(gives.room()) {
                Some(_) => {
                    format!("{holds} does not hold every {gives}: give the output less room in its FMU (maxSize)")
                }
                None => format!("{} does not hold every value of {}", kinds.1, kinds.0),
            });
        }
        if output.extents.len() != input.extents.len() {
            let shapes = (output.extents.len(), input.extents.len());
            return Err(format!("they have {} and {} dimensions", shapes.0, shapes.1));
        }
        let scaling = self.scaling(trace)?;
        let port =
            |about: &Description, one: &Variable| about.unit(one).map_or_else(|| Conversion::none("1"), Unit::of_port);
        let (factor, offset) = scaling.between(&port(sends, output), &port(takes, input))?;
        if !input.kind.is_float() && (factor.is_some() || offset.is_some()) {
            return Err(format!(
                "{} values are taken over as they are: leave units and transformations out",
                kinds.1
            ));
        }
        if output.feedthrough && !self.feedthrough_edges.contains(&(from, to)) {
            self.feedthrough_edges.push((from, to));
        }
        self.flat.connections.push(VariableConnection {
            from: (from, output.name.clone()),
            to: (to, input.name.clone()),
            factor,
            offset,
        });
        Ok(())
    }

    /// The outputs of the root, as figures; those that are transformed on their path are only noted.
    fn root_outputs(&mut self) {
        for connector in &self.structure.elements[0].connectors {
            if connector.kind != ConnectorKind::Output {
                continue;
            }
            let trace = match self.network.trace(0, &connector.name) {
                Ok(trace) => trace,
                Err(problem) => {
                    self.flat.problems.push(problem);
                    continue;
                }
            };
            let (origin, name) = trace.origin;
            let part = self.numbers[origin];
            let signal = self.variable(origin, name).filter(|variable| {
                let about = part.map(|part| &self.models[part].description);
                about.is_some_and(|about| element(about.version, variable).is_some())
            });
            let plain = self.scaling(&trace).is_ok_and(|scaling| scaling.is_identity());
            match part.zip(signal) {
                Some((part, signal)) if plain => self
                    .flat
                    .outputs
                    .push((connector.name.clone(), (part, signal.name.clone()))),
                Some(_) => {
                    let shown = self.structure.connector_path(origin, name);
                    let note = format!(
                        "the output `{}` of the system is made of `{shown}`, which is recorded as it is",
                        connector.name
                    );
                    self.flat.notes.push(note);
                }
                None => self
                    .flat
                    .notes
                    .push(format!("the output `{}` of the system has no source", connector.name)),
            }
        }
    }
}

/// Components that form an algebraic loop, in order; empty if there is none.
fn algebraic_loop(count: usize, edges: &[(usize, usize)]) -> Vec<usize> {
    // A component that feeds no remaining component is in no loop.
    let mut alive = vec![true; count];
    let feeds = |alive: &[bool], one: usize| {
        let own = edges.iter().filter(|(from, _)| *from == one);
        own.map(|(_, to)| *to).find(|to| alive[*to])
    };
    while let Some(end) = (0..count).find(|&one| alive[one] && feeds(&alive, one).is_none()) {
        alive[end] = false;
    }
    let Some(start) = (0..count).find(|&one| alive[one]) else {
        return Vec::new();
    };
    let mut path = vec![start];
    while let Some(next) = path.last().and_then(|&last| feeds(&alive, last)) {
        if let Some(at) = path.iter().position(|&one| one == next) {
            path.drain(..at);
            break;
        }
        path.push(next);
    }
    path
}
