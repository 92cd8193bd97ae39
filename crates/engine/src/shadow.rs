//! Shadows: a second program on the inputs of a participant, and the outputs that it would have published in its place.
//!
//! A participant's outputs follow from its inputs alone, and the tape has those. So a shadow need not run alongside the run: it is
//! replayed on the recorded inputs as soon as the run is over, with the same bits that it would have seen. It costs the run
//! nothing, and no failure of the shadow can affect the run, which is over by then.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;
use tape::compare::Comparison;

use crate::Catalogue;
use crate::replay::{Replay, Request};
use crate::run::{Ending, Options, RunFailure, port_discovery};
use crate::scenario::{Program, RunSpec, Scenario, ScenarioSpec};

/// What `--shadow NAME=PROGRAM` asks for.
#[derive(Debug, Clone, PartialEq)]
pub struct Shadow {
    participant: String,
    program: String,
    /// The program that shadows the participant.
    run: RunSpec,
    /// Changes of its parameters.
    set: Vec<String>,
}

/// The outputs of a shadow, compared with those in the run.
#[derive(Debug, Serialize)]
pub struct ShadowReport {
    /// The participant that it shadowed.
    pub participant: String,
    /// The program, as it was given.
    pub program: String,
    /// Why there is no comparison, if there is none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
    /// How its own run ended.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ending: Option<Ending>,
    /// Up to which instant it was fed, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
    /// Further notes.
    pub notes: Vec<String>,
    /// A is the run, B the shadow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
}

/// Splits `NAME=PROGRAM`, and resolves PROGRAM: `builtin:NAME`, or a file as the shell sees it: a library if its name ends with
/// `.so`, an FMU if it ends with `.fmu`, otherwise a program.
///
/// # Errors
/// What is wrong with the text.
pub fn in_place(text: &str, option: &str) -> Result<(String, RunSpec), String> {
    let parts = text
        .split_once('=')
        .map(|(name, program)| (name.trim(), program.trim()));
    let Some((participant, program)) = parts.filter(|(name, program)| !name.is_empty() && !program.is_empty()) else {
        return Err(format!(
            "{option} takes PARTICIPANT=PROGRAM, such as controller=./my-controller or controller=builtin:controller, not `{text}`"
        ));
    };
    let run = match program.strip_prefix("builtin:") {
        Some(builtin) => RunSpec::builtin(builtin),
        // A file is relative to the user's current directory, not to the scenario; a bare name may be that of a program in PATH.
        None if program.contains('/') || Program::key_of(program) != "exe" => {
            let absolute = std::path::absolute(program).map_err(|error| format!("{option}: `{program}`: {error}"))?;
            let text = absolute.into_os_string().into_string();
            let text =
                text.map_err(|path| format!("{option}: `{}` is not UTF-8: name a program that is", path.display()))?;
            RunSpec::of_file(&text)
        }
        None => RunSpec::of_file(program),
    };
    Ok((participant.to_owned(), run))
}

impl Shadow {
    /// Reads the values of `--shadow` and `--shadow-set`.
    ///
    /// # Errors
    /// What is wrong with the text.
    pub fn read(text: &str, set: &[String]) -> Result<Shadow, String> {
        let (participant, run) = in_place(text, "--shadow")?;
        let program = text
            .split_once('=')
            .map_or("", |(_, program)| program)
            .trim()
            .to_owned();
        if let Some(one) = set.iter().find(|one| !one.contains('=')) {
            return Err(format!(
                "--shadow-set takes KEY.PATH=VALUE, a parameter of the shadow, not `{one}`"
            ));
        }
        let set = set
            .iter()
            .map(|one| format!("participants.{participant}.parameters.{one}"));
        Ok(Shadow {
            set: set.collect(),
            participant,
            program,
            run,
        })
    }

    /// Checks, before anything runs, that it can replace its participant in a run of `scenario`, which was read from `file`. An
    /// external program is started briefly to ask for its ports.
    ///
    /// # Errors
    /// What is wrong with the program or its parameters, or how its ports differ.
    pub fn check(
        &self,
        catalogue: &Arc<Catalogue>,
        file: &Path,
        scenario: &ScenarioSpec,
        options: &Options,
    ) -> Result<(), RunFailure> {
        let ports = |spec: ScenarioSpec| -> Result<_, RunFailure> {
            let scenario = Scenario::of(catalogue, spec, file)?;
            // All other mistakes are reported first.
            scenario.make()?;
            let entry = scenario
                .participants
                .iter()
                .find(|entry| entry.setup.name == self.participant);
            let ports = entry.map(|entry| Ok((entry.clone(), port_discovery::ports(&scenario, entry, options)?)));
            let ports = ports.transpose();
            Ok((scenario, ports))
        };
        let (_, original) = ports(scenario.clone())?;
        let mut changed = scenario.clone();
        changed.set_run(&self.participant, &self.run, "given with --shadow")?;
        changed.change_as(&self.set, "given with --shadow-set")?;
        let (scenario, shadow) = ports(changed)?;
        let (Ok(Some((_, original))), shadow) = (original, shadow) else {
            // Mistakes in the run itself are reported when it starts.
            return Ok(());
        };
        match shadow {
            Ok(Some((entry, shadow))) => match shadow.difference(&original) {
                Some(difference) => {
                    let reason = format!("`{}` cannot be its shadow: {difference}", self.program);
                    Err(scenario.program_refusal(&entry, &reason).into())
                }
                None => Ok(()),
            },
            Ok(None) => Ok(()),
            Err(RunFailure::Participant { participant, reason }) => Err(RunFailure::Participant {
                participant,
                reason: format!("`{}` cannot be its shadow: it {reason}", self.program),
            }),
            Err(other) => Err(other),
        }
    }

    /// The folder of its own run: `shadow/NAME`, or `shadow/NAME-2` for the second shadow of a participant.
    fn own_folder(&self, folder: &Path) -> PathBuf {
        let all = folder.join("shadow");
        let numbered = (2..).map(|number| all.join(format!("{}-{number}", self.participant)));
        let mut places = std::iter::once(all.join(&self.participant)).chain(numbered);
        places.find(|place| !place.exists()).expect("there is no last number")
    }

    /// Replays it on its participant's inputs in the run in `folder`. Its own run is kept in `shadow/NAME` there, or
    /// `shadow/NAME-2` if that is taken.
    pub fn run(&self, catalogue: &Arc<Catalogue>, folder: &Path, options: &Options) -> ShadowReport {
        let mut account = ShadowReport {
            participant: self.participant.clone(),
            program: self.program.clone(),
            refused: None,
            ending: None,
            to_s: None,
            notes: Vec::new(),
            comparison: None,
        };
        let replay = Replay::plan(&Request {
            catalogue,
            folder,
            participant: &self.participant,
            overrides: &self.set,
            program: None,
            run: Some(&self.run),
            to: None,
            unverified: false,
        });
        let found = replay.and_then(|replay| {
            let in_process = options.in_process && !replay.external();
            replay.run(&Options {
                in_process,
                out: Some(self.own_folder(folder)),
                interrupt: options.interrupt.clone(),
                wait: options.wait,
                no_placement: options.no_placement,
                patience_s: options.patience_s,
                start_within: options.start_within,
                ..Options::default()
            })
        });
        match found {
            Ok(found) => {
                account.ending = Some(found.ending);
                account.to_s = Some(found.to_s);
                account.notes = found.notes;
                match found.comparison {
                    Ok(comparison) => account.comparison = Some(comparison),
                    Err(reason) => account.refused = Some(reason),
                }
            }
            Err(error) => account.refused = Some(error.to_string()),
        }
        account
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shadow_option_is_parsed_into_participant_and_program() {
        let set = ["law=\"reference\"".to_owned()];
        let shadow = Shadow::read("controller=builtin:controller", &set).unwrap();
        assert_eq!(shadow.run, RunSpec::builtin("controller"));
        assert_eq!(shadow.set, ["participants.controller.parameters.law=\"reference\""]);
        let exe = |file: &str| RunSpec::exe::<String>(file, []);
        let (name, run) = in_place("controller=/bin/true", "--substitute").unwrap();
        assert_eq!((name.as_str(), run), ("controller", exe("/bin/true")));
        assert!(in_place("controller=./x", "").unwrap().1.exe.unwrap().starts_with('/'));
        assert_eq!(in_place("controller=x", "").unwrap().1, exe("x"));
        for file in ["x.so", "./x.so"] {
            let library = in_place(&format!("controller={file}"), "").unwrap().1.library;
            assert!(library.is_some_and(|file| file.starts_with('/')), "{file}");
        }
        assert_eq!(in_place("controller=/x.so", "").unwrap().1, RunSpec::library("/x.so"));
        for bad in ["controller", "=x", "controller="] {
            assert!(in_place(bad, "--shadow").unwrap_err().contains("PARTICIPANT=PROGRAM"));
        }
        assert!(Shadow::read("a=b", &["x".into()]).is_err());
    }
}
