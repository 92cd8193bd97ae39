//! Reader of `modelDescription.xml`.

use std::collections::{BTreeMap, HashMap, HashSet};

use roxmltree::{Document, Node, ParsingOptions};

use super::content::{Capabilities, Description, Experiment, Version, by_name};
use super::experiment::discard_invalid_times;
use super::literals;
use super::nodes::{child, elements, range, text_of, type_of, words};
use super::units::{BaseUnit, Unit};
use super::variable::{Alias, Causality, Extent, Initial, Item, Range, Type, Variability, Variable};

/// Maximum size of a description, bytes.
pub const SIZE_MAX: usize = 64 << 20;
/// Maximum number of XML elements in a description.
const NODES_MAX: u32 = 8_000_000;

/// Why a description is rejected.
#[derive(Debug, thiserror::Error)]
pub enum DescriptionError {
    /// Not XML.
    #[error("modelDescription.xml: {0}")]
    Xml(#[from] roxmltree::Error),
    /// Larger than the limit.
    #[error("modelDescription.xml has {0} bytes; at most {SIZE_MAX} are read")]
    Size(usize),
    /// An element or attribute that is missing or wrong.
    #[error("modelDescription.xml:{line}: {reason}")]
    Content {
        /// The line, from 1.
        line: u32,
        /// The mistake.
        reason: String,
    },
}

/// A type that variables refer to by `declaredType`.
#[derive(Debug, Clone, Default)]
struct Declared {
    range: Range,
    unit: Option<String>,
    relative: bool,
    items: Vec<Item>,
}

struct Reader<'a> {
    document: &'a Document<'a>,
    version: Version,
    problems: Vec<String>,
}

impl Description {
    /// Reads the text of a `modelDescription.xml`.
    ///
    /// # Errors
    /// The missing or wrong element, with its line. Mistakes that can be tolerated are in [`Description::problems`].
    pub fn read(text: &str) -> Result<Description, DescriptionError> {
        if text.len() > SIZE_MAX {
            return Err(DescriptionError::Size(text.len()));
        }
        let options = ParsingOptions {
            nodes_limit: NODES_MAX,
            ..ParsingOptions::default()
        };
        let document = Document::parse_with_options(text, options)?;
        let root = document.root_element();
        let mut reader = Reader {
            document: &document,
            version: Version::Fmi3,
            problems: Vec::new(),
        };
        if !root.has_tag_name("fmiModelDescription") {
            let reason = format!("the root is `{}`, not `fmiModelDescription`", root.tag_name().name());
            return Err(reader.error(root, reason));
        }
        let version = reader.needed(root, "fmiVersion")?;
        reader.version = match version.as_str() {
            text if text.starts_with("2.") => Version::Fmi2,
            text if text.starts_with("3.") => Version::Fmi3,
            other => {
                return Err(reader.error(root, format!("FMI version `{other}`; 2.0 and 3.0 are supported")));
            }
        };
        reader.description(root)
    }
}

impl<'a> Reader<'a> {
    fn error(&self, node: Node<'_, '_>, reason: String) -> DescriptionError {
        let line = self.document.text_pos_at(node.range().start).row;
        DescriptionError::Content { line, reason }
    }

    fn needed(&self, node: Node<'_, '_>, name: &str) -> Result<String, DescriptionError> {
        let found = node.attribute(name).map(str::to_owned);
        found.ok_or_else(|| self.error(node, format!("`{}` has no `{name}`", node.tag_name().name())))
    }

    fn number<T: std::str::FromStr>(&self, node: Node<'_, '_>, name: &str) -> Result<Option<T>, DescriptionError> {
        let Some(text) = node.attribute(name) else {
            return Ok(None);
        };
        let read = text.trim().parse().map_err(|_| {
            let what = node.tag_name().name();
            self.error(node, format!("`{name}` of `{what}` is `{text}`, which is not a number"))
        });
        read.map(Some)
    }

    fn finite(&self, node: Node<'_, '_>, name: &str) -> Result<Option<f64>, DescriptionError> {
        let value = self.number::<f64>(node, name)?;
        if value.is_some_and(|value| !value.is_finite()) {
            return Err(self.error(node, format!("`{name}` is not finite")));
        }
        Ok(value)
    }

    fn flag(&self, node: Node<'_, '_>, name: &str) -> Result<bool, DescriptionError> {
        match node.attribute(name).map(str::trim) {
            None | Some("false" | "0") => Ok(false),
            Some("true" | "1") => Ok(true),
            Some(text) => Err(self.error(node, format!("`{name}` is `{text}`, neither true nor false"))),
        }
    }

    fn description(mut self, root: Node<'a, 'a>) -> Result<Description, DescriptionError> {
        let two = self.version == Version::Fmi2;
        let Some(own) = child(root, "CoSimulation") else {
            let reason = "it has no `CoSimulation`: only FMUs for co-simulation can take part; export it as one";
            return Err(self.error(root, reason.to_owned()));
        };
        let (state, serialise) = if two {
            ("canGetAndSetFMUstate", "canSerializeFMUstate")
        } else {
            ("canGetAndSetFMUState", "canSerializeFMUState")
        };
        let identifier = self.needed(own, "modelIdentifier")?;
        if identifier.is_empty() || identifier.contains(['/', '\0']) {
            return Err(self.error(
                own,
                format!(
                    "`modelIdentifier` is `{}`, no name of a file",
                    identifier.escape_debug()
                ),
            ));
        }
        let fixed_step = self.finite(own, "fixedInternalStepSize")?;
        if let Some(step) = fixed_step.filter(|step| *step <= 0.0) {
            return Err(self.error(own, format!("`fixedInternalStepSize` is {step}; it must be positive")));
        }
        let capabilities = Capabilities {
            identifier,
            needs_execution_tool: self.flag(own, "needsExecutionTool")?,
            once_per_process: self.flag(own, "canBeInstantiatedOnlyOncePerProcess")?,
            variable_step: self.flag(own, "canHandleVariableCommunicationStepSize")?,
            fixed_step,
            state: self.flag(own, state)?,
            serialise: self.flag(own, serialise)?,
            event_mode: self.flag(own, "hasEventMode")?,
        };
        let experiment = self.experiment(child(root, "DefaultExperiment"))?;
        let units = self.units(child(root, "UnitDefinitions"))?;
        let types = self.types(child(root, "TypeDefinitions"))?;
        let mut variables = self.variables(root, &units, &types)?;
        self.structure(root, &mut variables)?;
        let categories = elements(child(root, "LogCategories")).filter_map(|node| node.attribute("name"));
        let text = |name| root.attribute(name).unwrap_or_default().to_owned();
        Ok(Description {
            version: self.version,
            model: self.needed(root, "modelName")?,
            text: text("description"),
            tool: text("generationTool"),
            token: self.needed(root, if two { "guid" } else { "instantiationToken" })?,
            capabilities,
            experiment,
            differences: (units.iter())
                .filter_map(|(name, unit)| Some((name.clone(), unit.of_differences()?)))
                .collect(),
            units,
            by_name: by_name(&variables),
            variables,
            log_categories: categories.map(str::to_owned).collect(),
            problems: self.problems,
        })
    }

    fn experiment(&mut self, node: Option<Node<'a, 'a>>) -> Result<Experiment, DescriptionError> {
        let Some(node) = node else {
            return Ok(Experiment::default());
        };
        let mut experiment = Experiment {
            start: self.finite(node, "startTime")?,
            stop: self.finite(node, "stopTime")?,
            step: self.finite(node, "stepSize")?,
            tolerance: self.finite(node, "tolerance")?,
        };
        for invalid in discard_invalid_times(&mut experiment) {
            self.problem(node, invalid);
        }
        Ok(experiment)
    }

    fn units(&mut self, all: Option<Node<'a, 'a>>) -> Result<BTreeMap<String, Unit>, DescriptionError> {
        let mut units = BTreeMap::new();
        for node in elements(all) {
            let name = self.needed(node, "name")?;
            let mut base = None;
            if let Some(own) = child(node, "BaseUnit") {
                let mut exponents = [0; 8];
                for (symbol, exponent) in super::units::BASE.iter().zip(&mut exponents) {
                    *exponent = self.number(own, symbol)?.unwrap_or(0);
                }
                let factor = self.finite(own, "factor")?.unwrap_or(1.0);
                let offset = self.finite(own, "offset")?.unwrap_or(0.0);
                if factor == 0.0 {
                    return Err(self.error(own, format!("the factor of the unit `{name}` is zero")));
                }
                base = Some(BaseUnit {
                    exponents,
                    factor,
                    offset,
                });
            }
            units.insert(name.clone(), Unit { name, base });
        }
        Ok(units)
    }

    fn types(&mut self, all: Option<Node<'a, 'a>>) -> Result<HashMap<String, Declared>, DescriptionError> {
        let mut types = HashMap::new();
        for node in elements(all) {
            let name = self.needed(node, "name")?;
            // FMI 2.0 has the content in an element of its own.
            let own = match self.version {
                Version::Fmi2 => elements(Some(node)).next().unwrap_or(node),
                Version::Fmi3 => node,
            };
            let mut items = Vec::new();
            for item in own.children().filter(|child| child.has_tag_name("Item")) {
                let value = self.number(item, "value")?;
                let value = value.ok_or_else(|| self.error(item, "an item has no `value`".into()))?;
                let name = self.needed(item, "name")?;
                items.push(Item { name, value });
            }
            let declared = Declared {
                range: range(own),
                unit: own.attribute("unit").map(str::to_owned),
                relative: self.flag(own, "relativeQuantity")?,
                items,
            };
            types.insert(name, declared);
        }
        Ok(types)
    }

    fn variables(
        &mut self,
        root: Node<'a, 'a>,
        units: &BTreeMap<String, Unit>,
        types: &HashMap<String, Declared>,
    ) -> Result<Vec<Variable>, DescriptionError> {
        let Some(all) = child(root, "ModelVariables") else {
            return Err(self.error(root, "it has no `ModelVariables`".into()));
        };
        let (mut variables, mut names) = (Vec::new(), HashSet::new());
        for node in elements(Some(all)) {
            let mut variable = self.variable(node, types)?;
            if let Some(name) = variable.names().find(|&name| !names.insert(name.to_owned())) {
                return Err(self.error(node, format!("the variable `{name}` is there twice")));
            }
            if let Some(unit) = &variable.unit
                && !units.contains_key(unit)
            {
                self.problem(
                    node,
                    format!("`{}` has the unit `{unit}`, which is not defined", variable.name),
                );
                variable.unit = None;
            }
            for invalid in literals::invalid_literals(&variable) {
                self.problem(node, invalid);
            }
            variables.push(variable);
        }
        Ok(variables)
    }

    fn problem(&mut self, node: Node<'_, '_>, reason: String) {
        // The number of reported problems of one kind is limited.
        if self.problems.len() < 100 {
            let problem = self.error(node, reason).to_string();
            self.problems.push(problem);
        }
    }

    fn variable(
        &mut self,
        node: Node<'a, 'a>,
        types: &HashMap<String, Declared>,
    ) -> Result<Variable, DescriptionError> {
        let name = self.needed(node, "name")?;
        let reference = self.number(node, "valueReference")?;
        let reference = reference.ok_or_else(|| self.error(node, format!("`{name}` has no `valueReference`")))?;
        let own = match self.version {
            Version::Fmi2 => {
                let typed = elements(Some(node)).find(|child| type_of(child.tag_name().name()).is_some());
                typed.ok_or_else(|| self.error(node, format!("`{name}` has no type")))?
            }
            Version::Fmi3 => node,
        };
        let Some(kind) = type_of(own.tag_name().name()) else {
            return Err(self.error(
                node,
                format!("`{name}` has the unknown type `{}`", own.tag_name().name()),
            ));
        };
        let causality = self.causality(node, &name)?;
        let variability = self.variability(node, &name, kind)?;
        let initial = self.initial(node, &name, causality, variability)?;
        let declared = match own.attribute("declaredType") {
            None => Declared::default(),
            Some(declared) => match types.get(declared) {
                Some(declared) => declared.clone(),
                None => {
                    self.problem(
                        node,
                        format!("`{name}` has the type `{declared}`, which is not defined"),
                    );
                    Declared::default()
                }
            },
        };
        let limits = range(own);
        let text = matches!(kind, Type::String | Type::Binary);
        let start = match (self.version, text) {
            (Version::Fmi3, true) => elements(Some(node))
                .filter(|child| child.has_tag_name("Start"))
                .filter_map(|child| child.attribute("value").map(str::to_owned))
                .collect(),
            (Version::Fmi2, true) => own.attribute("start").map(str::to_owned).into_iter().collect(),
            _ => own.attribute("start").map(words).unwrap_or_default(),
        };
        let extents = self.extents(node, &name)?;
        Ok(Variable {
            reference,
            kind,
            causality,
            variability,
            initial,
            start,
            range: Range {
                min: limits.min.or(declared.range.min),
                max: limits.max.or(declared.range.max),
            },
            unit: own
                .attribute("unit")
                .map(str::to_owned)
                .or(declared.unit)
                .filter(|unit| !unit.is_empty()),
            relative: match own.has_attribute("relativeQuantity") {
                true => self.flag(own, "relativeQuantity")?,
                false => declared.relative,
            },
            items: declared.items,
            extents,
            feedthrough: false,
            text: text_of(node),
            aliases: self.aliases(node)?,
            name,
        })
    }

    fn aliases(&self, node: Node<'a, 'a>) -> Result<Vec<Alias>, DescriptionError> {
        let all = node.children().filter(|child| child.has_tag_name("Alias"));
        let read = all.map(|alias| {
            let text = text_of(alias);
            self.needed(alias, "name").map(|name| Alias { name, text })
        });
        read.collect()
    }

    fn extents(&self, node: Node<'_, '_>, name: &str) -> Result<Vec<Extent>, DescriptionError> {
        let mut extents = Vec::new();
        for dimension in node.children().filter(|child| child.has_tag_name("Dimension")) {
            let extent = match (
                self.number(dimension, "start")?,
                self.number(dimension, "valueReference")?,
            ) {
                (Some(fixed), None) => Extent::Fixed(fixed),
                (None, Some(reference)) => Extent::Parameter(reference),
                _ => {
                    let reason = format!("a dimension of `{name}` needs either `start` or `valueReference`");
                    return Err(self.error(dimension, reason));
                }
            };
            extents.push(extent);
        }
        Ok(extents)
    }

    fn causality(&self, node: Node<'_, '_>, name: &str) -> Result<Causality, DescriptionError> {
        Ok(match node.attribute("causality").unwrap_or("local") {
            "parameter" => Causality::Parameter,
            "calculatedParameter" => Causality::CalculatedParameter,
            "structuralParameter" => Causality::StructuralParameter,
            "input" => Causality::Input,
            "output" => Causality::Output,
            "local" => Causality::Local,
            "independent" => Causality::Independent,
            other => return Err(self.error(node, format!("`{name}` has the unknown causality `{other}`"))),
        })
    }

    fn variability(&self, node: Node<'_, '_>, name: &str, kind: Type) -> Result<Variability, DescriptionError> {
        Ok(match node.attribute("variability") {
            Some("constant") => Variability::Constant,
            Some("fixed") => Variability::Fixed,
            Some("tunable") => Variability::Tunable,
            Some("discrete") => Variability::Discrete,
            Some("continuous") => Variability::Continuous,
            None if kind.is_float() || self.version == Version::Fmi2 => Variability::Continuous,
            None => Variability::Discrete,
            Some(other) => return Err(self.error(node, format!("`{name}` has the unknown variability `{other}`"))),
        })
    }

    /// The value in the file, else that of the standard's table of causality and variability.
    fn initial(
        &self,
        node: Node<'_, '_>,
        name: &str,
        causality: Causality,
        variability: Variability,
    ) -> Result<Option<Initial>, DescriptionError> {
        Ok(match node.attribute("initial") {
            Some("exact") => Some(Initial::Exact),
            Some("approx") => Some(Initial::Approx),
            Some("calculated") => Some(Initial::Calculated),
            Some(other) => return Err(self.error(node, format!("`{name}` has the unknown initial `{other}`"))),
            None => Initial::by_default(causality, variability),
        })
    }

    /// The outputs with direct feedthrough from inputs. Without `dependencies` an output may depend on all inputs.
    fn structure(&mut self, root: Node<'a, 'a>, variables: &mut [Variable]) -> Result<(), DescriptionError> {
        let structure = child(root, "ModelStructure");
        let two = self.version == Version::Fmi2;
        let list = if two {
            structure.and_then(|node| child(node, "Outputs"))
        } else {
            structure
        };
        let inputs = |variables: &[Variable]| -> HashSet<u64> {
            let own = variables
                .iter()
                .enumerate()
                .filter(|(_, one)| one.causality == Causality::Input);
            own.map(|(number, one)| {
                if two {
                    number as u64 + 1
                } else {
                    u64::from(one.reference)
                }
            })
            .collect()
        };
        let inputs = inputs(variables);
        let at = variables.iter().enumerate();
        let at: HashMap<u64, usize> = match two {
            true => at.map(|(number, _)| (number as u64 + 1, number)).collect(),
            false => at.map(|(number, one)| (u64::from(one.reference), number)).collect(),
        };
        for node in elements(list).filter(|node| node.has_tag_name(if two { "Unknown" } else { "Output" })) {
            let key: Option<u64> = self.number(node, if two { "index" } else { "valueReference" })?;
            let Some(key) = key else { continue };
            let depends = match node.attribute("dependencies") {
                None => !inputs.is_empty(),
                Some(text) => text
                    .split_whitespace()
                    .filter_map(|word| word.parse().ok())
                    .any(|one| inputs.contains(&one)),
            };
            let found = at.get(&key).map(|&number| &mut variables[number]);
            match found {
                Some(variable) => variable.feedthrough = depends,
                None => self.problem(
                    node,
                    format!("the model structure names the variable {key}, which is not there"),
                ),
            }
        }
        Ok(())
    }
}
