//! Making participants in this process from entries.

use lockstep::participant::Participant;

use super::entry::Entry;
use super::error::{Mistake, ScenarioError};
use super::program::Program;
use super::resolve::Scenario;

type OptionalParticipant = Option<Box<dyn Participant>>;

impl Scenario {
    /// Makes every participant that this program contains, and returns `None` for the others. No library is loaded.
    ///
    /// # Errors
    /// All parameters that are refused.
    pub fn make(&self) -> Result<Vec<OptionalParticipant>, ScenarioError> {
        self.make_with(|entry| match entry.program {
            Program::Library { .. } | Program::External { .. } => Ok(None),
            Program::Builtin(_) | Program::Fmu { .. } => self.participant_of(entry),
        })
    }

    /// Makes every participant that can run in this process, including those of libraries, which are loaded; returns `None` for the
    /// others.
    ///
    /// # Errors
    /// All libraries that cannot be used, and all parameters that are refused.
    pub fn make_here(&self) -> Result<Vec<OptionalParticipant>, ScenarioError> {
        self.make_with(|entry| self.participant_of(entry))
    }

    /// The participant of `entry` in this process; `None` when it is an external program that no catalogue can make here.
    ///
    /// # Errors
    /// A library that cannot be used, or a parameter that is refused.
    pub fn participant(&self, entry: &Entry) -> Result<OptionalParticipant, ScenarioError> {
        let participant = self.participant_of(entry);
        participant.map_err(|mistake| self.source.error(vec![mistake]))
    }

    fn make_with(
        &self,
        make: impl Fn(&Entry) -> Result<OptionalParticipant, Mistake>,
    ) -> Result<Vec<OptionalParticipant>, ScenarioError> {
        let (mut all, mut mistakes) = (Vec::new(), Vec::new());
        for entry in &self.participants {
            match make(entry) {
                Ok(participant) => all.push(participant),
                Err(mistake) => mistakes.push(mistake),
            }
        }
        if mistakes.is_empty() {
            Ok(all)
        } else {
            Err(self.source.error(mistakes))
        }
    }

    fn participant_of(&self, entry: &Entry) -> Result<OptionalParticipant, Mistake> {
        let participant = match &entry.program {
            Program::Builtin(_) | Program::Fmu { .. } => {
                let factory = self.builtins().factory_of(&entry.program);
                factory.map(|factory| factory(&entry.setup))
            }
            Program::Library { file, participant } => {
                let found = plugin::Library::open(file).and_then(|library| library.participant(participant.as_deref()));
                let table = found.map_err(|wrong| self.source.mistake(&entry.run_key, wrong.to_string()))?;
                Some(plugin::Foreign::make(table, &entry.setup))
            }
            Program::External { .. } => {
                let factory = self.builtins().factory_within(&entry.program);
                factory.map(|factory| factory(&entry.setup))
            }
        };
        participant
            .transpose()
            .map_err(|error| self.refusal_mistake(entry, &error.key, &error.reason))
    }

    /// The mistake for a refusal by a participant, with its place in the file: a parameter, or the program itself.
    pub(super) fn refusal_mistake(&self, entry: &Entry, key: &str, reason: &str) -> Mistake {
        if key == plugin::NO_PARTICIPANT {
            let reason = format!("participant `{}`: {reason}", entry.setup.name);
            return self.source.mistake(&entry.run_key, reason);
        }
        self.parameter_mistake(entry, key, reason)
    }
}
