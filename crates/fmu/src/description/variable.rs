//! Variables of an FMU.

/// The type of a variable's elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
#[allow(missing_docs, reason = "the names are the standard's")]
pub enum Type {
    Float64,
    Float32,
    Int8,
    UInt8,
    Int16,
    UInt16,
    Int32,
    UInt32,
    Int64,
    UInt64,
    Boolean,
    Enumeration,
    String,
    Binary,
    Clock,
}

impl Type {
    /// The name in FMI 3.0.
    pub const fn name(self) -> &'static str {
        match self {
            Type::Float64 => "Float64",
            Type::Float32 => "Float32",
            Type::Int8 => "Int8",
            Type::UInt8 => "UInt8",
            Type::Int16 => "Int16",
            Type::UInt16 => "UInt16",
            Type::Int32 => "Int32",
            Type::UInt32 => "UInt32",
            Type::Int64 => "Int64",
            Type::UInt64 => "UInt64",
            Type::Boolean => "Boolean",
            Type::Enumeration => "Enumeration",
            Type::String => "String",
            Type::Binary => "Binary",
            Type::Clock => "Clock",
        }
    }

    /// Whether it is a floating-point number.
    pub const fn is_float(self) -> bool {
        matches!(self, Type::Float64 | Type::Float32)
    }

    /// Whether a limit or a start value in a description is a value of this type.
    pub fn holds(self, text: &str) -> bool {
        match (self, self.integers()) {
            (Type::Float64, _) => text.parse::<f64>().is_ok(),
            // A limit may be infinite; a number may not become so.
            (Type::Float32, _) => {
                let both = text.parse::<f64>().ok().zip(text.parse::<f32>().ok());
                both.is_some_and(|(exact, single)| single.is_infinite() == exact.is_infinite())
            }
            (Type::Boolean, _) => matches!(text, "true" | "false" | "0" | "1"),
            (_, Some((least, largest))) => {
                let value = text.parse::<i128>();
                value.is_ok_and(|value| (least..=largest).contains(&value))
            }
            // The size of a Binary, and no limits of other types.
            _ => true,
        }
    }

    /// The least and the largest value of an integer type.
    pub const fn integers(self) -> Option<(i128, i128)> {
        Some(match self {
            Type::Int8 => (i8::MIN as i128, i8::MAX as i128),
            Type::UInt8 => (0, u8::MAX as i128),
            Type::Int16 => (i16::MIN as i128, i16::MAX as i128),
            Type::UInt16 => (0, u16::MAX as i128),
            Type::Int32 => (i32::MIN as i128, i32::MAX as i128),
            Type::UInt32 => (0, u32::MAX as i128),
            Type::Int64 | Type::Enumeration => (i64::MIN as i128, i64::MAX as i128),
            Type::UInt64 => (0, u64::MAX as i128),
            _ => return None,
        })
    }
}

/// The role of a variable.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the standard's")]
pub enum Causality {
    Parameter,
    CalculatedParameter,
    StructuralParameter,
    Input,
    Output,
    Local,
    Independent,
}

/// When a variable may change.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the standard's")]
pub enum Variability {
    Constant,
    Fixed,
    Tunable,
    Discrete,
    Continuous,
}

/// How the initial value of a variable is determined.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[allow(missing_docs, reason = "the names are the standard's")]
pub enum Initial {
    Exact,
    Approx,
    Calculated,
}

impl Initial {
    /// The default according to the standard's table of causality and variability.
    pub(super) const fn by_default(causality: Causality, variability: Variability) -> Option<Initial> {
        match (causality, variability) {
            (Causality::Input | Causality::Independent, _) => None,
            (Causality::Parameter | Causality::StructuralParameter, _) => Some(Initial::Exact),
            (_, Variability::Constant) => Some(Initial::Exact),
            _ => Some(Initial::Calculated),
        }
    }
}

/// An item of an enumeration.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Item {
    /// Its name.
    pub name: String,
    /// Its value.
    pub value: i64,
}

/// The extent of an array in one dimension.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// A constant.
    Fixed(u64),
    /// The value of the structural parameter with this reference.
    Parameter(u32),
}

/// Limits, as in the file: as text, so that integers keep all of their digits.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Range {
    /// The least value.
    pub min: Option<String>,
    /// The largest value.
    pub max: Option<String>,
}

/// Another name of a variable (FMI 3.0). Its display unit is left out: values are in the unit of the variable.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Alias {
    /// The name.
    pub name: String,
    /// Its description.
    pub text: String,
}

/// A variable.
#[derive(Debug, Clone, PartialEq)]
pub struct Variable {
    /// Its name.
    pub name: String,
    /// Its other names. In FMI 2.0 an alias is a variable of its own, with the same value reference.
    pub aliases: Vec<Alias>,
    /// Its value reference, which functions use.
    pub reference: u32,
    /// The type of its elements.
    pub kind: Type,
    /// Its role.
    pub causality: Causality,
    /// When it may change.
    pub variability: Variability,
    /// How its initial value is determined; none for inputs.
    pub initial: Option<Initial>,
    /// Its start values, as text; empty when there are none.
    pub start: Vec<String>,
    /// Limits.
    pub range: Range,
    /// The name of its unit.
    pub unit: Option<String>,
    /// Whether it is a difference of two quantities, so that the offset of its unit does not apply (`relativeQuantity`).
    pub relative: bool,
    /// The items of an enumeration.
    pub items: Vec<Item>,
    /// Extents, outermost first; empty for a scalar.
    pub extents: Vec<Extent>,
    /// Whether an output has direct feedthrough from an input, according to the description.
    pub feedthrough: bool,
    /// Its description.
    pub text: String,
}

impl Variable {
    /// All of its names, its own first.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let others = self.aliases.iter().map(|alias| alias.name.as_str());
        std::iter::once(self.name.as_str()).chain(others)
    }

    /// Whether a scenario may set it before the run.
    ///
    /// # Errors
    /// Why not.
    pub fn settable(&self) -> Result<(), String> {
        let reason = match (self.causality, self.variability, self.initial) {
            (Causality::Independent, ..) => "it is the time",
            (_, Variability::Constant, _) => "it is a constant",
            (Causality::CalculatedParameter, ..) => "the FMU calculates it from other parameters",
            (Causality::Parameter | Causality::StructuralParameter | Causality::Input, ..) => return Ok(()),
            (.., Some(Initial::Exact | Initial::Approx)) => return Ok(()),
            (Causality::Output, ..) => "it is an output that the FMU calculates",
            _ => "it is a local variable that the FMU calculates",
        };
        Err(reason.to_owned())
    }
}
