//! Reading a scenario as a value, and editing it by key paths.

use std::path::Path;

use toml::Value;

use super::change::{self, IN_CODE, VARIED};
use super::changes::Changes;
use super::read::PartialScenario;
use super::scenario_spec::ScenarioSpec;
use crate::scenario::error::{Mistake, ScenarioError};

impl ScenarioSpec {
    /// Reads `file`, with the contents of the files that it names, and makes `changes`, each `key.path=value` or
    /// `faults+=key=value,…` as `--set` and `--fault` take them.
    ///
    /// # Errors
    /// All mistakes in its form, with lines and keys.
    pub fn read(file: &Path, changes: &[String]) -> Result<ScenarioSpec, ScenarioError> {
        ScenarioSpec::changed(file, &changes.into())
    }

    /// Reads `file` with `changes`.
    ///
    /// # Errors
    /// As [`ScenarioSpec::read`].
    pub fn changed(file: &Path, changes: &Changes) -> Result<ScenarioSpec, ScenarioError> {
        PartialScenario::of_file(file, changes)?.into_spec()
    }

    /// Reads `text` as if it were the content of `file`.
    ///
    /// # Errors
    /// As [`ScenarioSpec::read`].
    pub fn of_text(file: &Path, text: &str) -> Result<ScenarioSpec, ScenarioError> {
        PartialScenario::of_text(file, text.to_owned(), &Changes::default())?.into_spec()
    }

    /// Sets a key such as `participants.tank.parameters.depth` to `value`, by the rules of `--set`: participants and connections
    /// must exist.
    ///
    /// # Errors
    /// When there is no such key, or the value does not fit it.
    pub fn set(&mut self, key: &str, value: impl Into<Value>) -> Result<(), ScenarioError> {
        let value = value.into();
        self.edit(|table, origin| change::set(table, origin, key, value, IN_CODE))
    }

    /// Makes changes given as texts, each `key.path=value` or `faults+=key=value,…` as `--set` and `--fault` take them.
    ///
    /// # Errors
    /// When one of them is not a valid change, or the resulting scenario is inconsistent.
    pub fn change(&mut self, changes: &[String]) -> Result<(), ScenarioError> {
        self.change_as(changes, IN_CODE)
    }

    /// As [`ScenarioSpec::change`], for what a campaign varies from point to point.
    pub(crate) fn vary(&mut self, changes: &[String]) -> Result<(), ScenarioError> {
        self.change_as(changes, VARIED)
    }

    /// As [`ScenarioSpec::change`], for changes whose origin is `how`; a message about one of them ends with `how`.
    pub(crate) fn change_as(&mut self, changes: &[String], how: &'static str) -> Result<(), ScenarioError> {
        if changes.is_empty() {
            return Ok(());
        }
        self.edit(|table, origin| {
            let mut changes = changes.iter();
            changes.try_for_each(|one| change::change(table, origin, one, how))
        })
    }

    /// Makes all of `changes`, or none.
    ///
    /// # Errors
    /// When one of them does not fit, or the resulting scenario is inconsistent.
    pub fn apply(&mut self, changes: &Changes) -> Result<(), ScenarioError> {
        *self = PartialScenario::of_spec(self.clone())
            .with_changes(changes)?
            .into_spec()?;
        Ok(())
    }

    fn edit(
        &mut self,
        edit: impl FnOnce(&mut toml::Table, &mut super::origin::Origin) -> Result<(), Mistake>,
    ) -> Result<(), ScenarioError> {
        let (mut table, mut origin) = (self.to_table(), self.origin.clone());
        edit(&mut table, &mut origin).map_err(|mistake| origin.error(vec![mistake]))?;
        *self = PartialScenario::of_table(origin, table, &Changes::default())?.into_spec()?;
        Ok(())
    }
}
