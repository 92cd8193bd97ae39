//! The variables of an exported FMU: every field of its ports, the parameters that are numbers, and the time.

use lockstep::port::{Descriptor, Element, EnumValue};

use crate::kind::{VariableKind, Version};
use crate::parameter::Parameter;
use crate::refusal::Refusal;

/// The location of a variable's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ValueLocation {
    /// The present time.
    Time,
    /// The parameter of this number.
    Parameter(usize),
    /// In the payload of the input of this number, from this byte on.
    Input(usize, usize),
    /// In the payload of the output of this number, from this byte on.
    Output(usize, usize),
    /// The figure of merit of this number.
    Figure(usize),
}

/// A variable. Its value reference is its position in the list.
#[derive(Debug, Clone)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Its description.
    pub description: String,
    /// The location of its value.
    pub place: ValueLocation,
    /// Its type.
    pub kind: VariableKind,
    /// The items of an enumeration.
    pub items: Vec<EnumValue>,
    /// Its extents; empty for a scalar.
    pub extents: Vec<u32>,
    /// The number of its elements.
    pub len: usize,
    /// Its unit; `1` without one.
    pub unit: String,
    /// The index of its element in the parameter, if the variable is one scalar of a list.
    pub first: usize,
}

impl Variable {
    /// Checks that an element of an enumeration is one of its items.
    ///
    /// # Errors
    /// The rejected value and the valid ones.
    pub fn check(&self, element: &[u8]) -> Result<(), Refusal> {
        let byte = element.first().copied().unwrap_or_default();
        if self.kind != VariableKind::Enumeration || self.items.iter().any(|item| item.value == byte) {
            return Ok(());
        }
        Err(Refusal::discard(format!(
            "cannot be set to {byte}, which is no item of its enumeration"
        )))
    }
}

/// A port.
#[derive(Debug, Clone)]
pub struct Port {
    /// The prefix of its variables.
    pub name: String,
    /// The message type.
    pub descriptor: Descriptor,
}

/// Everything that becomes a variable.
#[derive(Debug, Clone, Default)]
pub struct Ports {
    /// The inputs, which the importer sets.
    pub inputs: Vec<Port>,
    /// The outputs, which the importer reads.
    pub outputs: Vec<Port>,
    /// Figures of merit, by name and unit.
    pub figures: Vec<(String, String)>,
    /// Whether outputs depend on inputs at the same instant (direct feedthrough).
    pub feedthrough: bool,
    /// Whether values change only at communication points.
    pub discrete: bool,
}

/// All variables, in the order of their value references.
pub fn variables(version: Version, ports: &Ports, parameters: &[Parameter]) -> Vec<Variable> {
    let mut all = Vec::new();
    // FMI 3.0 requires it; in FMI 2.0 the parsers of many tools report an error for it.
    if version == Version::Fmi3 {
        all.push(Variable {
            name: "time".into(),
            description: "Simulated time".into(),
            place: ValueLocation::Time,
            kind: VariableKind::Number(Element::F64),
            items: Vec::new(),
            extents: Vec::new(),
            len: 1,
            unit: "s".into(),
            first: 0,
        });
    }
    for (number, parameter) in parameters.iter().enumerate() {
        let whole = Variable {
            name: parameter.name.clone(),
            description: String::new(),
            place: ValueLocation::Parameter(number),
            kind: parameter.kind,
            items: Vec::new(),
            extents: parameter.extents.clone(),
            len: parameter.len(),
            unit: parameter.unit.clone(),
            first: 0,
        };
        push(version, &mut all, whole, |first| {
            (ValueLocation::Parameter(number), first)
        });
    }
    for (number, port) in ports.inputs.iter().enumerate() {
        fields(version, &mut all, port, |at| ValueLocation::Input(number, at));
    }
    for (number, port) in ports.outputs.iter().enumerate() {
        fields(version, &mut all, port, |at| ValueLocation::Output(number, at));
    }
    for (number, (name, unit)) in ports.figures.iter().enumerate() {
        all.push(Variable {
            name: format!("figures.{name}"),
            description: "Figure of merit of what has been simulated so far; NaN where it is not known".into(),
            place: ValueLocation::Figure(number),
            kind: VariableKind::Number(Element::F64),
            items: Vec::new(),
            extents: Vec::new(),
            len: 1,
            unit: unit.clone(),
            first: 0,
        });
    }
    all
}

fn fields(version: Version, all: &mut Vec<Variable>, port: &Port, place: impl Fn(usize) -> ValueLocation) {
    for field in &port.descriptor.fields {
        let (offset, size) = (field.offset as usize, field.element.size());
        let description = if field.frame.is_empty() {
            port.descriptor.name.clone()
        } else {
            format!("{}, components in frame {}", port.descriptor.name, field.frame)
        };
        let description = match field.element.room() {
            Some(room) => format!("{description}, at most {room} bytes"),
            None => description,
        };
        let whole = Variable {
            name: format!("{}.{}", port.name, field.name),
            description,
            place: place(offset),
            kind: VariableKind::of(field.element),
            items: field.values.clone(),
            extents: field.shape.clone(),
            len: field.len(),
            unit: field.unit.clone(),
            first: 0,
        };
        push(version, all, whole, |first| (place(offset + first * size), 0));
    }
}

/// Adds an array: one variable in FMI 3.0, one per element in FMI 2.0, which has only scalars.
fn push(version: Version, all: &mut Vec<Variable>, whole: Variable, element: impl Fn(usize) -> (ValueLocation, usize)) {
    if version == Version::Fmi3 || whole.extents.is_empty() {
        all.push(whole);
        return;
    }
    for number in 0..whole.len {
        let (place, first) = element(number);
        all.push(Variable {
            name: format!("{}{}", whole.name, indices(&whole.extents, number)),
            place,
            first,
            extents: Vec::new(),
            len: 1,
            ..whole.clone()
        });
    }
}

/// `[1][2]`: the indices of an element stored in row-major order.
fn indices(extents: &[u32], mut number: usize) -> String {
    let mut places = Vec::new();
    for &extent in extents.iter().rev() {
        let extent = extent as usize;
        places.push(format!("[{}]", number % extent));
        number /= extent;
    }
    places.reverse();
    places.concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lockstep::port::Message;

    lockstep::message! {
        /// One field of each shape.
        pub struct Some {
            /// A matrix.
            pub matrix: [[f64; 3]; 2] = "m" in "N",
            /// A number.
            pub number: u32 = "1",
            /// Another number.
            pub single: f32 = "rad",
        }
    }

    #[test]
    fn array_becomes_one_variable_or_scalars() {
        let port = Port {
            name: "out".into(),
            descriptor: Some::descriptor(),
        };
        let ports = Ports {
            outputs: vec![port],
            ..Ports::default()
        };
        let three = variables(Version::Fmi3, &ports, &[]);
        let names: Vec<&str> = three.iter().map(|one| one.name.as_str()).collect();
        assert_eq!(names, ["time", "out.matrix", "out.number", "out.single"]);
        assert_eq!((three[1].extents.as_slice(), three[1].len), (&[2, 3][..], 6));
        let two = variables(Version::Fmi2, &ports, &[]);
        assert_eq!(two.len(), 8);
        assert_eq!(two[5].name, "out.matrix[1][2]");
        assert_eq!(two[5].place, ValueLocation::Output(0, 40));
        assert_eq!(two[6].place, ValueLocation::Output(0, 48));
    }
}
