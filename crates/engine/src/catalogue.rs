//! The catalogue: the participants and the assessments that a program contains.

use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;

use lockstep::participant::{Factory, ParameterError, Participant, Setup};
use lockstep::time::Rational;
use report::view::{View, Views};
use tape::StreamSpec;
use toml::Table;

use crate::assessment::{Assessment, AssessmentSetup};
use crate::builtins::{Builtins, HasBuiltins};
use crate::campaign::{Cases, CasesError};
use crate::replay::player;
use crate::scenario::{Program, Scenario};

/// Warnings about a scenario before it runs; none of them keeps the scenario from running.
type Warnings = Arc<dyn Fn(&Scenario) -> Vec<String> + Send + Sync>;

/// Warnings about a scenario that continues a run of the other one.
type ChangeWarnings = Arc<dyn Fn(&Scenario, &Scenario) -> Vec<String> + Send + Sync>;

/// A finding of `check` about a scenario.
#[derive(Debug, Clone)]
pub struct Finding {
    /// Its key in the JSON.
    pub name: String,
    /// The finding for people: one or more lines.
    pub text: String,
    /// The finding for scripts.
    pub value: serde_json::Value,
    /// The warnings that follow from it, for a run.
    pub warnings: Vec<String>,
}

type Findings = Arc<dyn Fn(&Scenario) -> Vec<Finding> + Send + Sync>;

/// Makes the cases of a campaign of failures.
type Failures = Arc<dyn Fn(&Scenario, &Path, &[Rational], bool) -> Result<Cases, CasesError> + Send + Sync>;

/// The participants and assessments that a scenario can name without an external program.
///
/// ```
/// use engine::Catalogue;
/// # use lockstep::participant::{ParameterError, Participant, Setup};
/// # fn make(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> { Err(ParameterError::new("", "an example")) }
///
/// let catalogue = Catalogue::new("lander 1.0").participant("lander", make);
/// assert!(catalogue.names().eq(["lander"]));
/// ```
#[derive(Clone)]
pub struct Catalogue {
    builtins: Arc<Builtins>,
    warnings: Vec<Warnings>,
    change_warnings: Vec<ChangeWarnings>,
    findings: Vec<Findings>,
    failures: Option<Failures>,
    views: Vec<Views>,
}

impl Deref for Catalogue {
    type Target = Builtins;

    fn deref(&self) -> &Builtins {
        &self.builtins
    }
}

impl HasBuiltins for Catalogue {
    fn builtins(&self) -> &Arc<Builtins> {
        &self.builtins
    }
}

impl HasBuiltins for Arc<Catalogue> {
    fn builtins(&self) -> &Arc<Builtins> {
        &self.builtins
    }
}

impl Catalogue {
    /// An empty catalogue, for a program that calls itself `version`, such as `lander 1.0`.
    pub fn new(version: impl Into<String>) -> Catalogue {
        let catalogue = Catalogue {
            builtins: Arc::new(Builtins::new(version.into())),
            warnings: Vec::new(),
            change_warnings: Vec::new(),
            findings: Vec::new(),
            failures: None,
            views: Vec::new(),
        };
        catalogue.internal(player::NAME, player::factory)
    }

    fn builtins_mut(&mut self) -> &mut Builtins {
        Arc::make_mut(&mut self.builtins)
    }

    /// Adds a participant that scenarios name as `run = { builtin = "NAME" }`.
    #[must_use]
    pub fn participant(
        mut self,
        name: &str,
        make: impl Fn(&Setup) -> Result<Box<dyn Participant>, ParameterError> + Send + Sync + 'static,
    ) -> Catalogue {
        self.builtins_mut().add_participant(name, Arc::new(make));
        self
    }

    /// Adds a participant that only scenarios made by the program itself name.
    #[must_use]
    pub fn internal(
        mut self,
        name: &str,
        make: impl Fn(&Setup) -> Result<Box<dyn Participant>, ParameterError> + Send + Sync + 'static,
    ) -> Catalogue {
        self.builtins_mut().add_internal(name, Arc::new(make));
        self
    }

    /// Adds an assessment that scenarios name as `kind = "KIND"` in the table `assessment`.
    #[must_use]
    pub fn assessment(
        mut self,
        kind: &str,
        make: impl Fn(&AssessmentSetup) -> Result<Box<dyn Assessment>, ParameterError> + Send + Sync + 'static,
    ) -> Catalogue {
        self.builtins_mut().add_assessment(kind, Arc::new(make));
        self
    }

    /// Adds warnings about scenarios, which `run` and `check` print.
    #[must_use]
    pub fn warning(mut self, warnings: impl Fn(&Scenario) -> Vec<String> + Send + Sync + 'static) -> Catalogue {
        self.warnings.push(Arc::new(warnings));
        self
    }

    /// Adds warnings about a scenario that continues a run, given that of the run, which `resume` prints.
    #[must_use]
    pub fn change_warning(
        mut self,
        warnings: impl Fn(&Scenario, &Scenario) -> Vec<String> + Send + Sync + 'static,
    ) -> Catalogue {
        self.change_warnings.push(Arc::new(warnings));
        self
    }

    /// Adds findings about a scenario, which `check` reports.
    #[must_use]
    pub fn finding(mut self, find: impl Fn(&Scenario) -> Vec<Finding> + Send + Sync + 'static) -> Catalogue {
        self.findings.push(Arc::new(find));
        self
    }

    /// Sets the list of failures for a campaign of failures that is given none: of the scenario, which was read from the file, from
    /// the start and from each of the instants; and also with a control law that is informed of them.
    #[must_use]
    pub fn failures(
        mut self,
        list: impl Fn(&Scenario, &Path, &[Rational], bool) -> Result<Cases, CasesError> + Send + Sync + 'static,
    ) -> Catalogue {
        self.failures = Some(Arc::new(list));
        self
    }

    /// Adds figures for the report of a run, made from its streams and its plan: what the application's users look at first. They
    /// come after the figures that a scenario declares itself.
    #[must_use]
    pub fn view(mut self, view: impl Fn(&[StreamSpec], &Table) -> View + Send + Sync + 'static) -> Catalogue {
        self.views.push(Arc::new(view));
        self
    }

    /// Sets a way to make in this process what scenarios name as an external program, if `find` knows the program: a run in one
    /// loop then uses it. An interpreter with the engine as a module has one for the models in its language.
    #[must_use]
    pub fn within(mut self, find: impl Fn(&Program) -> Option<Factory> + Send + Sync + 'static) -> Catalogue {
        self.builtins_mut().set_within(Arc::new(find));
        self
    }

    /// Replaces the version.
    #[must_use]
    pub fn with_version(mut self, version: &str) -> Catalogue {
        self.builtins_mut().set_version(version);
        self
    }

    /// The warnings about `scenario`, which continues a run of `unchanged`.
    pub fn change_warnings(&self, scenario: &Scenario, unchanged: &Scenario) -> Vec<String> {
        let all = self.change_warnings.iter();
        all.flat_map(|warnings| warnings(scenario, unchanged)).collect()
    }

    /// The warnings about `scenario`, without the findings.
    pub fn warnings(&self, scenario: &Scenario) -> Vec<String> {
        self.warnings_with(scenario, &self.findings(scenario))
    }

    /// The warnings about `scenario`, whose `findings` are given.
    pub fn warnings_with(&self, scenario: &Scenario, findings: &[Finding]) -> Vec<String> {
        let of_program = self.warnings.iter().flat_map(|warnings| warnings(scenario));
        let found = findings.iter().flat_map(|finding| finding.warnings.iter().cloned());
        scenario.warnings().into_iter().chain(of_program).chain(found).collect()
    }

    /// The findings of `check` about `scenario`.
    pub fn findings(&self, scenario: &Scenario) -> Vec<Finding> {
        self.findings.iter().flat_map(|find| find(scenario)).collect()
    }

    /// Every failure that this program knows of, as the cases of a campaign.
    ///
    /// # Errors
    /// When it knows of none, or none fits the scenario.
    pub fn every_failure(
        &self,
        scenario: &Scenario,
        file: &Path,
        at: &[Rational],
        informed: bool,
    ) -> Result<Cases, CasesError> {
        match &self.failures {
            Some(list) => list(scenario, file, at, informed),
            None => Err(CasesError {
                path: file.to_owned(),
                line: None,
                reason: "this program has no list of failures: list the cases in a file and give it with --cases"
                    .into(),
            }),
        }
    }

    /// The views that reports of this program have.
    pub fn views(&self) -> &[Views] {
        &self.views
    }
}
