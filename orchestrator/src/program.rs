//! A program: the whole command line over a catalogue.

use std::io::{ErrorKind, Write, stdout};
use std::process::ExitCode;

use clap::FromArgMatches;
use engine::Catalogue;
use lockstep::participant::{ParameterError, Participant, Setup};

use crate::cli::{self, Cli, Command};
use crate::templates::Template;
use crate::{bench, catalogue, commands, limits, output, refusal, version};

/// A program with the whole command line, and with participants and assessments of its own inside.
///
/// ```no_run
/// use std::process::ExitCode;
///
/// use lockstep::participant::{ParameterError, Participant, Setup};
/// use orchestrator::Program;
///
/// # fn lander(_: &Setup) -> Result<Box<dyn Participant>, ParameterError> { Err(ParameterError::new("", "an example")) }
/// fn main() -> ExitCode {
///     Program::new("lander").participant("lander", lander).main()
/// }
/// ```
///
/// A scenario names such a participant as `run = { builtin = "lander" }`. It runs in a process of its own, which is this program
/// started once more, or with `--in-process` and in campaigns in this one.
pub struct Program {
    name: String,
    /// Its own; what it is built on says its own version besides.
    version: Option<String>,
    catalogue: Catalogue,
    templates: &'static [Template],
}

impl Program {
    /// A program without participants, called `name` on its help page.
    pub fn new(name: impl Into<String>) -> Program {
        Program {
            name: name.into(),
            version: None,
            catalogue: Catalogue::new(version::ESCAPEMENT),
            templates: &[],
        }
    }

    /// With a version of its own, as `--version` prints it and `run.json` keeps it: `env!("CARGO_PKG_VERSION")` mostly.
    #[must_use]
    pub fn version(mut self, version: impl Into<String>) -> Program {
        self.version = Some(version.into());
        self
    }

    /// With projects to start from, of which `new` writes one.
    #[cfg(feature = "capture")]
    #[must_use]
    pub(crate) fn templates(mut self, templates: &'static [Template]) -> Program {
        self.templates = templates;
        self
    }

    /// With a participant that scenarios name as `run = { builtin = "NAME" }`.
    #[must_use]
    pub fn participant(
        mut self,
        name: &str,
        make: impl Fn(&Setup) -> Result<Box<dyn Participant>, ParameterError> + Send + Sync + 'static,
    ) -> Program {
        self.catalogue = self.catalogue.participant(name, make);
        self
    }

    /// With whatever else a catalogue holds: assessments, warnings, findings, a list of failures, figures for reports.
    ///
    /// ```no_run
    /// use engine::Catalogue;
    /// use orchestrator::Program;
    ///
    /// fn contents(catalogue: Catalogue) -> Catalogue {
    ///     catalogue.remark(|scenario| vec![format!("`{}` was written in a hurry", scenario.title)])
    /// }
    ///
    /// fn main() -> std::process::ExitCode {
    ///     Program::new("lander").contents(contents).main()
    /// }
    /// ```
    #[must_use]
    pub fn contents(mut self, fill: impl FnOnce(Catalogue) -> Catalogue) -> Program {
        self.catalogue = fill(self.catalogue);
        self
    }

    /// Reads the command line and does what it asks for.
    pub fn main(self) -> ExitCode {
        if let Some(missing) = engine::processor::missing() {
            eprintln!(
                "error: this program is compiled for x86-64-v3 processors (2013 and later) and this one lacks {missing}: remove the line \
                 `rustflags` from .cargo/config.toml and build again; results stay the same to the last bit, at a fraction of the speed"
            );
            return ExitCode::from(1);
        }
        // The command line's texts live as long as the program.
        let name: &'static str = self.name.leak();
        let version: &'static str = version::of_program(name, self.version.as_deref()).leak();
        let mut line = cli::command().name(name).bin_name(name).version(version);
        if self.templates.is_empty() {
            line = line.mut_subcommand("new", |new| new.hide(true));
        }
        let matches = line.clone().try_get_matches();
        let cli = match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
            Ok(cli) => cli,
            Err(answer) => return answered(&answer),
        };
        let catalogue = self.catalogue.with_version(version);
        catalogue::set(bench::register(catalogue));
        execute(&cli.command, line, self.templates)
    }
}

fn execute(command: &Command, line: clap::Command, templates: &[Template]) -> ExitCode {
    limits::refuse_large_files();
    // A participant is a program of its own that happens to live in this file: it reports as one.
    if let Command::Participant(args) = command {
        return commands::participant::run(args);
    }
    limits::raise_open_files();
    // Shared memory that is full ends a run in order, not the program.
    if let Err(error) = engine::run::guard_memory() {
        eprintln!("error: SIGBUS cannot be taken over: {error}");
        return ExitCode::from(1);
    }
    let result = match command {
        Command::Run(args) => commands::run::run(args),
        Command::Resume(args) => commands::resume::run(args),
        Command::Check(args) => commands::check::run(args),
        Command::Graph(args) => commands::graph::run(args),
        Command::Compare(args) => commands::compare::run(args),
        Command::Measure(args) => commands::measure::run(args),
        Command::Replay(args) => commands::replay::run(args),
        Command::Report(args) => commands::report::run(args),
        Command::Export(args) => commands::export::run(args),
        #[cfg(feature = "capture")]
        Command::Model(args) => commands::model::run(args).map(|()| 0),
        #[cfg(feature = "capture")]
        Command::Tune(args) => commands::tune::run(args),
        #[cfg(feature = "capture")]
        Command::Margins(args) => commands::margins::run(args),
        Command::Sweep(args) => commands::shards::run(args),
        Command::Faults(args) => commands::faults::run(args),
        Command::Bench(args) => commands::bench::run(args),
        Command::New(args) => Ok(commands::new::run(args, line.get_name(), templates)),
        Command::Completions(args) => Ok(commands::completions::run(args, &line)),
        Command::Man(args) => commands::man::run(args, line),
        Command::Fmu(args) => commands::fmu::run(args),
        Command::Import(args) => Ok(commands::import::run(args)),
        Command::Doctor(args) => commands::doctor::run(args),
        Command::CampaignWorker => {
            let tasks = std::io::BufReader::new(std::io::stdin());
            engine::campaign::serve(catalogue::catalogue(), tasks, std::io::stdout())
                .map(|()| 0)
                .map_err(Into::into)
        }
        Command::Participant(_) => Ok(0),
    };
    let unwritten = output::unwritten();
    let code = match result {
        Ok(code) => code,
        Err(error) => {
            let words = refusal::words(&error);
            // That of the output is told below.
            if unwritten != Some(words.as_str()) {
                eprintln!("error: {words}");
            }
            refusal::exit_code(&error)
        }
    };
    match unwritten {
        Some(reason) => unheard(reason),
        None => ExitCode::from(code as u8),
    }
}

/// Prints what the command line itself is answered with: help, the version, or what is wrong with it.
fn answered(answer: &clap::Error) -> ExitCode {
    match answer.print().and_then(|()| stdout().flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe && !answer.use_stderr() => unheard(&error.to_string()),
        _ => ExitCode::from(answer.exit_code() as u8),
    }
}

/// Whatever was done, not all of what the program says of it could be written.
fn unheard(reason: &str) -> ExitCode {
    eprintln!("error: standard output cannot be written: {reason}");
    ExitCode::from(1)
}
