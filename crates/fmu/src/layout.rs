//! The ports of an FMU, and how their payloads become values of its variables.

use std::collections::{HashMap, HashSet};

use lockstep::participant::{Input, Inputs, Interface, Kind, Output, Outputs, ParameterError};
use lockstep::port::{Descriptor, Element, Field};

use crate::abi::Native;
use crate::aliases::Aliases;
use crate::description::{Causality, Conversion, Description, Type, Variable, Version};
use crate::items::Items;
use crate::names::unknown;
use crate::options::{FieldEntry, Form, Options};
use crate::settings::Settings;
use crate::transfer::{Slot, Transfer};

/// The port of all inputs.
pub const INPUTS: &str = "inputs";
/// The port of all outputs.
pub const OUTPUTS: &str = "outputs";
/// The default name of the message of a port: the same for all, so that FMUs can be connected.
pub const MESSAGE: &str = "Signals";
/// The port of additionally recorded variables.
pub const RECORDED: &str = "recorded";

/// Ports and transfers.
#[derive(Debug, Clone)]
pub struct Layout {
    /// The ports.
    pub interface: Interface,
    /// The transfers that set values before a step.
    pub inputs: Vec<Transfer>,
    /// The transfers that read values after a step.
    pub outputs: Vec<Transfer>,
    /// The other names of fields that have the names of their variables.
    pub aliases: Aliases,
}

/// Maximum size of a text, bytes, unless the scenario sets it.
pub const TEXT_ROOM: u32 = 256;
/// Maximum size of a Binary, bytes, unless the scenario or its FMU (`maxSize`) sets it.
pub const BYTES_ROOM: u32 = 1024;

/// The element of a field for a variable; none for variables that are not signals. Texts and bytes are signals only where
/// they are named, because they take their maximum size in each sample.
pub fn element(version: Version, variable: &Variable) -> Option<Element> {
    Some(match variable.kind {
        Type::Float64 => Element::F64,
        Type::Float32 => Element::F32,
        Type::Int8 => Element::I8,
        Type::Int16 => Element::I16,
        Type::Int32 => Element::I32,
        Type::UInt8 => Element::U8,
        Type::UInt16 => Element::U16,
        Type::UInt32 => Element::U32,
        Type::Boolean => Element::Bool,
        Type::Int64 => Element::I64,
        Type::UInt64 => Element::U64,
        Type::Enumeration if !Items::of(variable).values.is_empty() => Element::Enum,
        Type::Enumeration if version == Version::Fmi2 => Element::I32,
        Type::Enumeration => Element::I64,
        Type::String => Element::Text(TEXT_ROOM),
        Type::Binary => {
            let own = variable.range.max.as_ref().and_then(|max| max.parse().ok());
            let fits = |room: &u32| (1..=Descriptor::MAX_SIZE / 2).contains(room);
            Element::Bytes(own.filter(fits).unwrap_or(BYTES_ROOM))
        }
        Type::Clock => return None,
    })
}

/// Whether a variable may be without a value, and so is in no port unless `ports` names it: the figures of merit of a
/// scenario that was exported by this program are NaN until they are known.
pub fn may_lack_value(description: &Description, variable: &Variable) -> bool {
    let figure = variable.causality == Causality::Output && variable.name.starts_with("figures.");
    figure && description.tool.starts_with("Escapement")
}

/// The element according to an entry: with another maximum size, or another integer type.
fn with_form(variable: &Variable, element: Element, (size, other): Form) -> Result<Element, String> {
    if let Some(other) = other {
        let whole = |element: Element| element.is_number() && element.range().is_some();
        if size.is_some() || !whole(element) || !whole(other) {
            return Err(format!(
                "`{}` is a {}, and the element of its field {}: one of i8 to i64 and u8 to u64 takes the place of another one",
                variable.name,
                variable.kind.name(),
                other.name()
            ));
        }
        return Ok(other);
    }
    match (size, element) {
        (None, element) => Ok(element),
        (Some(size), Element::Text(_)) if size > 0 => Ok(Element::Text(size)),
        (Some(size), Element::Bytes(_)) if size > 0 => Ok(Element::Bytes(size)),
        (Some(size), _) => Err(format!(
            "`{}` is a {}, and its size is {size} bytes: a size belongs to a String or a Binary, and is 1 at least",
            variable.name,
            variable.kind.name()
        )),
    }
}

/// A field with its variables.
struct PlannedField<'a> {
    field: Field,
    variables: Vec<&'a Variable>,
    conversion: Conversion,
}

/// The name of the bytes that fill a payload: `padding`, unless a field has that name. All of these names need not be fed.
fn padding(fields: &[Field]) -> String {
    let mut name = "padding".to_owned();
    let mut number = 1;
    while fields.iter().any(|field| field.name == name) {
        number += 1;
        name = format!("padding_{number}");
    }
    name
}

/// Why an input cannot be set by a field if `other` is already set by one.
fn set_twice_text(other: &str, variable: &Variable) -> String {
    let (name, reference) = (&variable.name, variable.reference);
    if other == name {
        return format!("the input `{name}` stands in two fields");
    }
    format!(
        "the inputs `{other}` and `{name}` have the same value reference {reference}, so they are one value, which only one field can set: \
         leave out one of them with `ports`"
    )
}

struct Planner<'a> {
    description: &'a Description,
    settings: &'a Settings,
    layout: Layout,
    /// The inputs that a field sets, by their transfer and reference.
    set: HashMap<(usize, u32), &'a str>,
}

impl Layout {
    /// The ports of an FMU according to the scenario.
    ///
    /// # Errors
    /// Names the key below `run`.
    pub fn new(description: &Description, options: &Options, settings: &Settings) -> Result<Layout, ParameterError> {
        let kind = if options.feedthrough {
            Kind::Sampled
        } else {
            Kind::Continuous
        };
        let mut planner = Planner {
            description,
            settings,
            set: HashMap::new(),
            layout: Layout {
                interface: Interface::new(kind),
                inputs: Vec::new(),
                outputs: Vec::new(),
                aliases: Aliases::default(),
            },
        };
        let mut named = [options.ports.contains_key(INPUTS), options.ports.contains_key(OUTPUTS)];
        let mut all = Vec::new();
        for (port, entries) in &options.ports {
            let key = format!("ports.{port}");
            let input = planner
                .direction(port, entries)
                .map_err(|reason| ParameterError::new(&key, reason))?;
            named[usize::from(!input)] = true;
            let fields = planner
                .listed(entries)
                .map_err(|reason| ParameterError::new(&key, reason))?;
            all.push((key, port.as_str(), input, fields));
        }
        for (is_named, port, causality) in [
            (named[0], INPUTS, Causality::Input),
            (named[1], OUTPUTS, Causality::Output),
        ] {
            if !is_named {
                let fields = planner
                    .default_fields(causality)
                    .map_err(|reason| ParameterError::new("fmu", reason))?;
                all.push(("fmu".to_owned(), port, causality == Causality::Input, fields));
            }
        }
        let record = planner
            .listed(&options.record)
            .map_err(|reason| ParameterError::new("record", reason))?;
        all.push(("record".to_owned(), RECORDED, false, record));
        for (key, port, input, fields) in all {
            let message = options.messages.get(port).map_or(MESSAGE, String::as_str);
            let put = planner.port(port, message, input, fields);
            put.map_err(|reason| ParameterError::new(key, reason))?;
        }
        let own = &planner.layout.interface;
        let known = |name: &String| {
            own.inputs.iter().any(|port| port.name == *name) || own.outputs.iter().any(|port| port.name == *name)
        };
        if let Some(name) = options.messages.keys().find(|name| !known(name)) {
            return Err(ParameterError::new(format!("messages.{name}"), "there is no such port"));
        }
        let checked = planner.layout.interface.validate();
        checked.map_err(|error| ParameterError::new("ports", error))?;
        let Layout { inputs, outputs, .. } = &mut planner.layout;
        inputs.iter_mut().chain(outputs).for_each(Transfer::merge_contiguous);
        Ok(planner.layout)
    }

    /// Copies the payloads of the input ports into the values.
    ///
    /// # Errors
    /// Names a value that the variable cannot represent.
    pub fn read(&mut self, inputs: &Inputs) -> Result<(), String> {
        self.inputs.iter_mut().try_for_each(|transfer| transfer.read(inputs))
    }

    /// Copies the values into the payloads of the output ports.
    ///
    /// # Errors
    /// Names a value that is not an item of its enumeration.
    pub fn write(&self, outputs: &mut Outputs) -> Result<(), String> {
        self.outputs.iter().try_for_each(|transfer| transfer.write(outputs))
    }
}

impl<'a> Planner<'a> {
    fn variable(&self, name: &str) -> Result<&'a Variable, String> {
        let description = self.description;
        let known = description.variables.iter().flat_map(Variable::names);
        description.variable(name).ok_or_else(|| unknown(name, known))
    }

    /// Whether the variables of a port are inputs.
    fn direction(&self, port: &str, entries: &[FieldEntry]) -> Result<bool, String> {
        let (mut input, mut output) = (None, None);
        for entry in entries {
            for name in entry.parts().1 {
                let variable = self.variable(name)?;
                match variable.causality {
                    Causality::Input => input = Some(&variable.name),
                    _ => output = Some(&variable.name),
                }
            }
        }
        match (input, output) {
            (Some(input), Some(output)) => Err(format!(
                "`{input}` is an input and `{output}` is none; a port has one direction"
            )),
            (Some(_), None) => Ok(true),
            (None, Some(_)) => Ok(false),
            (None, None) if port == INPUTS || port == OUTPUTS => Ok(port == INPUTS),
            (None, None) => Err(format!(
                "the port has no variables; only `{INPUTS} = []` and `{OUTPUTS} = []` mean something: none"
            )),
        }
    }

    /// All variables of one causality that are signals by default, ordered so that the payload has no gaps.
    fn default_fields(&self, causality: Causality) -> Result<Vec<PlannedField<'a>>, String> {
        let version = self.description.version;
        let own = self
            .description
            .variables
            .iter()
            .filter(|one| one.causality == causality);
        let own = own.filter(|one| !may_lack_value(self.description, one));
        let own = own.filter(|one| !self.settings.is_empty(one));
        let signals = own.filter(|one| element(version, one).is_some_and(|one| one.room().is_none()));
        let mut fields = signals
            .map(|one| self.field(one.name.clone(), vec![one], false, (None, "", (None, None))))
            .collect::<Result<Vec<_>, _>>()?;
        fields.sort_by_key(|planned| std::cmp::Reverse(planned.field.element.align()));
        Ok(fields)
    }

    fn listed(&self, entries: &[FieldEntry]) -> Result<Vec<PlannedField<'a>>, String> {
        let planned = entries.iter().map(|entry| {
            let (name, variables, listed, unit, frame) = entry.parts();
            let variables = variables
                .into_iter()
                .map(|name| self.variable(name))
                .collect::<Result<Vec<_>, _>>()?;
            self.field(name, variables, listed, (unit, frame, entry.form()))
        });
        planned.collect()
    }

    fn field(
        &self,
        name: String,
        variables: Vec<&'a Variable>,
        listed: bool,
        (unit, frame, form): (Option<&str>, &str, Form),
    ) -> Result<PlannedField<'a>, String> {
        let first = *variables
            .first()
            .ok_or_else(|| format!("the field `{name}` has no variables"))?;
        let version = self.description.version;
        let Some(element) = element(version, first) else {
            let kind = first.kind.name();
            return Err(format!("`{}` is a {kind}, which is no signal", first.name));
        };
        let element = with_form(first, element, form)?;
        let own = self.description.unit(first);
        if let Some(other) = variables
            .iter()
            .find(|one| (one.kind, self.description.unit(one), &one.items) != (first.kind, own, &first.items))
        {
            return Err(format!(
                "`{}` and `{}` have different types, items or units and cannot be one field",
                first.name, other.name
            ));
        }
        let shape = if listed {
            if let Some(array) = variables.iter().find(|one| !one.extents.is_empty()) {
                return Err(format!(
                    "`{}` is an array already; list scalars, or name it alone",
                    array.name
                ));
            }
            vec![variables.len() as u32]
        } else {
            self.settings
                .shape(first)
                .map_err(|reason| format!("`{}`: {reason}", first.name))?
        };
        let conversion = match (own, unit) {
            (None, None) => Conversion::none("1"),
            // The FMU states no unit, so the user's applies.
            (None, Some(unit)) => Conversion::none(unit),
            (Some(own), None) => own.of_port(),
            (Some(own), Some(unit)) => own.to(unit).map_err(|reason| format!("`{}`: {reason}", first.name))?,
        };
        if !conversion.is_none() && !first.kind.is_float() {
            return Err(format!(
                "`{}` is a {}, whose unit cannot be converted",
                first.name,
                first.kind.name()
            ));
        }
        let items = Items::of(first);
        if !element.is_number() && conversion.unit != "1" {
            return Err(format!("`{}` is a {} and has no unit", first.name, first.kind.name()));
        }
        let field = Field {
            name,
            element,
            shape,
            unit: conversion.unit.clone(),
            frame: frame.to_owned(),
            offset: 0,
            values: items.values,
        };
        Ok(PlannedField {
            field,
            variables,
            conversion,
        })
    }

    /// Adds a port; none if there are no fields.
    fn port(&mut self, name: &str, message: &str, input: bool, fields: Vec<PlannedField<'a>>) -> Result<(), String> {
        if fields.is_empty() {
            return Ok(());
        }
        let number = if input {
            self.layout.interface.inputs.len()
        } else {
            self.layout.interface.outputs.len()
        };
        self.add_aliases(name, &fields);
        let mut offset = 0_usize;
        let mut largest = 1;
        let mut described = Vec::new();
        for mut planned in fields {
            let (size, align) = (planned.field.element.size(), planned.field.element.align());
            if !offset.is_multiple_of(align) {
                return Err(format!(
                    "`{}` has elements of {align} bytes and would start at byte {offset}: list the fields with larger elements first",
                    planned.field.name
                ));
            }
            if offset > Descriptor::MAX_SIZE as usize {
                return Err(format!("the port has more than {} bytes", Descriptor::MAX_SIZE));
            }
            planned.field.offset = offset as u32;
            self.slots(input, number, &planned)?;
            offset += planned.field.len() * size;
            largest = largest.max(align);
            described.push(planned.field);
        }
        let rest = offset.next_multiple_of(largest) - offset;
        if rest > 0 {
            let name = padding(&described);
            described.push(Field {
                name,
                element: Element::U8,
                shape: vec![rest as u32],
                unit: "1".into(),
                frame: String::new(),
                offset: offset as u32,
                values: Vec::new(),
            });
        }
        let descriptor = Descriptor {
            name: message.to_owned(),
            size: (offset + rest) as u32,
            fields: described,
        };
        let name = name.to_owned();
        let interface = &mut self.layout.interface;
        if input {
            let required = true;
            interface.inputs.push(Input {
                name,
                descriptor,
                required,
            });
        } else {
            interface.outputs.push(Output { name, descriptor });
        }
        Ok(())
    }

    /// A field that has one name of its variable has the others too, unless another field has them.
    fn add_aliases(&mut self, port: &str, fields: &[PlannedField<'a>]) {
        let taken: HashSet<&str> = fields.iter().map(|planned| planned.field.name.as_str()).collect();
        for planned in fields {
            let field = &planned.field.name;
            if let [variable] = planned.variables[..]
                && variable.names().any(|name| name == field)
            {
                let others = variable.names().filter(|name| !taken.contains(name));
                others.for_each(|name| self.layout.aliases.add(port, name, field));
            }
        }
    }

    fn slots(&mut self, input: bool, port: usize, planned: &PlannedField<'a>) -> Result<(), String> {
        let version = self.description.version;
        let field = &planned.field;
        let each = field.len() / planned.variables.len();
        for (number, variable) in planned.variables.iter().enumerate() {
            let native = Native::of(version, variable.kind).ok_or_else(|| {
                format!(
                    "`{}` is a {}, which FMI 2.0 does not have",
                    variable.name,
                    variable.kind.name()
                )
            })?;
            let transfers = if input {
                &mut self.layout.inputs
            } else {
                &mut self.layout.outputs
            };
            let at = transfers
                .iter()
                .position(|one| one.values.native == native)
                .unwrap_or_else(|| {
                    transfers.push(Transfer::new(native));
                    transfers.len() - 1
                });
            let transfer = &mut transfers[at];
            if input && let Some(other) = self.set.insert((at, variable.reference), &variable.name) {
                return Err(set_twice_text(other, variable));
            }
            let first = transfer.values.count;
            transfer.values.push(variable.reference, each);
            transfer.values.make_room(field.element.room().unwrap_or(0));
            let conversion = &planned.conversion;
            transfer.slots.push(Slot {
                port,
                offset: field.offset as usize + number * each * field.element.size(),
                element: field.element,
                first,
                len: each,
                conversion: (!conversion.is_none()).then_some((conversion.factor, conversion.offset)),
                items: Items::of(variable),
                name: variable.name.clone(),
            });
        }
        Ok(())
    }
}
