//! Changes of a scenario by options.

use serde::{Deserialize, Serialize};

use super::fault::FaultSpec;
use super::run::RunSpec;
use super::scenario_spec::ScenarioSpec;
use super::time::Time;
use crate::scenario::error::{Mistake, ScenarioError};

/// How a change was made: the end of a message about it.
pub(super) const WITH_SUBSTITUTE: &str = "given with --substitute";
pub(super) const WITH_FAULT: &str = "given with --fault";
pub(super) const WITH_SEED: &str = "given with --seed";
pub(super) const WITH_DURATION: &str = "given with --duration";

/// Changes of a scenario, in the order in which they are applied.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Changes {
    /// Programs that replace those of participants.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub substitutes: Vec<(String, RunSpec)>,
    /// Keys, each `key.path=value` or `faults+=key=value,…`.
    #[serde(rename = "changes")]
    pub set: Vec<String>,
    /// Additional faults.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub faults: Vec<FaultSpec>,
    /// A different seed.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// A different length of the run.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub duration: Option<Time>,
}

impl From<&[String]> for Changes {
    fn from(set: &[String]) -> Changes {
        Changes {
            set: set.to_vec(),
            ..Changes::default()
        }
    }
}

impl Changes {
    /// Whether the changes give `key` another value.
    pub fn fixes(&self, key: &str) -> bool {
        let own = match key {
            "seed" => self.seed.is_some(),
            "duration" => self.duration.is_some(),
            key => self.substitutes.iter().any(|(name, _)| run_of(name) == key),
        };
        own || self.set.iter().any(|one| key_of(one) == key)
    }

    /// Whether a key that is set belongs to the program of a substitute, which it then changes or replaces.
    pub(super) fn changes_substitute(&self) -> bool {
        let runs = self.substitutes.iter().map(|(name, _)| run_of(name));
        let below = |key: &str, table: &str| {
            let rest = key.strip_prefix(table);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        };
        let mut pairs = runs.flat_map(|run| self.set.iter().map(move |one| (run.clone(), key_of(one))));
        pairs.any(|(run, key)| below(key, &run) || below(&run, key))
    }
}

fn run_of(participant: &str) -> String {
    format!("participants.{participant}.run")
}

fn key_of(one: &str) -> &str {
    one.split('=').next().unwrap_or_default().trim()
}

impl ScenarioSpec {
    /// Replaces the program of `participant` by `run`; `how` is the origin of the change.
    ///
    /// # Errors
    /// When there is no such participant.
    pub(crate) fn set_run(&mut self, participant: &str, run: &RunSpec, how: &'static str) -> Result<(), ScenarioError> {
        let key = format!("participants.{participant}.run");
        match self.participants.get_mut(participant) {
            Some(own) => {
                own.run = run.clone();
                self.origin.record_change(key, how);
                Ok(())
            }
            None => {
                let known: Vec<String> = self.participants.keys().map(|name| format!("`{name}`")).collect();
                let reason = format!(
                    "there is no `{participant}` in `participants` ({how}); there is {}",
                    known.join(", ")
                );
                let line = None;
                Err(self.origin.error(vec![Mistake { line, key, reason }]))
            }
        }
    }
}
