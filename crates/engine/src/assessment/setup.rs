//! What an assessment is made from.

use std::collections::BTreeMap;

use tape::StreamSpec;
use toml::Table;

/// What an assessment is made from.
#[derive(Debug, Clone)]
pub struct AssessmentSetup<'a> {
    /// The table `assessment` of the scenario.
    pub table: &'a Table,
    /// The streams of the run; an assessment receives samples by their numbers.
    pub streams: &'a [StreamSpec],
    /// The parameters of each participant, by its name, as the scenario has them: without the participant's own defaults.
    pub parameters: BTreeMap<&'a str, &'a Table>,
}
