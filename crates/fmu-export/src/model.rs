//! Construction of an FMU's body, parameters and variables from its resources.

use engine::scenario::Scenario;
use lockstep::time::Rational;

use crate::body::Body;
use crate::manifest::{Content, Manifest};
use crate::parameter::{Parameter, parameters};
use crate::single::ParticipantBody;
use crate::variable::{Variable, variables};
use crate::whole::ScenarioBody;

/// Everything of an FMU except its life cycle.
pub struct Model {
    /// The body.
    pub body: Box<dyn Body>,
    /// The parameters that may be set before the start.
    pub parameters: Vec<Parameter>,
    /// All variables.
    pub variables: Vec<Variable>,
    /// Steps are whole multiples of this.
    pub period: Rational,
    /// The start of the experiment.
    pub start: Rational,
    /// The end of the experiment.
    pub stop: Option<Rational>,
    /// Whether its state can be saved.
    pub can_save_state: bool,
}

impl Model {
    /// Builds the model, without starting anything.
    ///
    /// # Errors
    /// The reason why it cannot be built.
    pub fn new(content: Content) -> Result<Model, String> {
        let Content { manifest, scenario, .. } = content;
        match manifest.participant.clone() {
            Some(name) => Model::of_participant(&manifest, scenario, &name),
            None => Model::of_scenario(&manifest, scenario),
        }
    }

    fn of_participant(manifest: &Manifest, scenario: Scenario, name: &str) -> Result<Model, String> {
        let entry = scenario
            .participants
            .iter()
            .find(|entry| entry.setup.name == name)
            .cloned();
        let entry = entry.ok_or_else(|| format!("there is no participant `{name}` in its scenario"))?;
        let duration = scenario.duration;
        let single = ParticipantBody::new(scenario, entry)?;
        let (table, seed) = single.parameters();
        let parameters = parameters(table, seed);
        let variables = variables(manifest.version(), single.ports(), &parameters);
        Ok(Model {
            period: single.period(),
            start: single.offset(),
            stop: Some(duration).filter(|stop| *stop > single.offset()),
            body: Box::new(single),
            parameters,
            variables,
            can_save_state: manifest.state,
        })
    }

    fn of_scenario(manifest: &Manifest, scenario: Scenario) -> Result<Model, String> {
        let whole = ScenarioBody::new(scenario, &manifest.inputs, &manifest.outputs, manifest.state)?;
        Ok(Model {
            period: whole.period(),
            start: Rational::ZERO,
            stop: Some(whole.duration()),
            variables: variables(manifest.version(), whole.ports(), &[]),
            body: Box::new(whole),
            parameters: Vec::new(),
            can_save_state: manifest.state,
        })
    }
}
