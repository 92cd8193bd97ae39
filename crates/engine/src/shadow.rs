//! A second program on the inputs of a participant: what it would have said in its place.
//!
//! What a participant says follows from its inputs alone, and the tape has those. So a shadow need not run beside the run: it
//! is replayed on the recorded inputs as soon as the run is over, with the bits that it would have seen. It costs the run
//! nothing, and whatever happens to it, the run has happened already.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;
use tape::compare::Comparison;

use crate::Catalogue;
use crate::replay::{Replay, Request};
use crate::run::{Ending, Options, RunFailure, describe};
use crate::scenario::{Program, RunSpec, Scenario, ScenarioSpec};

/// What `--shadow NAME=PROGRAM` asks for.
#[derive(Debug, Clone, PartialEq)]
pub struct Shadow {
    participant: String,
    program: String,
    /// What stands in the participant's place.
    run: RunSpec,
    /// Changes of its parameters.
    set: Vec<String>,
}

/// What a shadow said, against what was said in the run.
#[derive(Debug, Serialize)]
pub struct Account {
    /// Whose place it shadowed.
    pub participant: String,
    /// The program, as it was given.
    pub program: String,
    /// Why there is nothing to compare, if so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
    /// How its own run ended.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ending: Option<Ending>,
    /// Up to where it was fed, s.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub to_s: Option<f64>,
    /// What else there is to say.
    pub notes: Vec<String>,
    /// A is the run, B the shadow.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub comparison: Option<Comparison>,
}

/// `NAME=PROGRAM` in two parts, with what PROGRAM stands for: `builtin:NAME`, or a file as the shell sees it: a library if its name ends
/// with `.so`, an FMU if it ends with `.fmu`, else a program.
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
        // A file is relative to where the user is, not to the scenario; a bare name may be one of a program in PATH.
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
    /// Reads what was given with `--shadow` and `--shadow-set`.
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

    /// Whether it can stand in its place in a run of `scenario`, which was read from `file`: that is refused before anything runs. A
    /// program of its own is started for a moment, to ask for its ports.
    ///
    /// # Errors
    /// What is wrong with the program or its parameters, or the difference of its ports.
    pub fn check(
        &self,
        catalogue: &Arc<Catalogue>,
        file: &Path,
        scenario: &ScenarioSpec,
        options: &Options,
    ) -> Result<(), RunFailure> {
        let ports = |spec: ScenarioSpec| -> Result<_, RunFailure> {
            let scenario = Scenario::of(catalogue, spec, file)?;
            // Whatever else is wrong with it is told first.
            scenario.make()?;
            let entry = scenario
                .participants
                .iter()
                .find(|entry| entry.setup.name == self.participant);
            let ports = entry.map(|entry| Ok((entry.clone(), describe::ports(&scenario, entry, options)?)));
            let ports = ports.transpose();
            Ok((scenario, ports))
        };
        let (_, original) = ports(scenario.clone())?;
        let mut changed = scenario.clone();
        changed.set_run(&self.participant, &self.run, "given with --shadow")?;
        changed.change_as(&self.set, "given with --shadow-set")?;
        let (scenario, shadow) = ports(changed)?;
        let (Ok(Some((_, original))), shadow) = (original, shadow) else {
            // What is wrong with the run itself is said when it starts.
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

    /// The folder of its own run: `shadow/NAME`, and `shadow/NAME-2` of the second one of a participant.
    fn own_folder(&self, folder: &Path) -> PathBuf {
        let all = folder.join("shadow");
        let numbered = (2..).map(|number| all.join(format!("{}-{number}", self.participant)));
        let mut places = std::iter::once(all.join(&self.participant)).chain(numbered);
        places.find(|place| !place.exists()).expect("there is no last number")
    }

    /// Feeds it what its participant was fed in the run in `folder`. Its own run is kept in `shadow/NAME` there, or `shadow/NAME-2` where
    /// that is taken.
    pub fn run(&self, catalogue: &Arc<Catalogue>, folder: &Path, options: &Options) -> Account {
        let mut account = Account {
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
                account.comparison = Some(found.comparison);
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
    fn a_shadow_stands_in_the_place_of_its_participant() {
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
