//! Program: the whole command line over a catalogue.

use std::io::{ErrorKind, Write, stdout};
use std::process::ExitCode;

use clap::FromArgMatches;
use engine::Catalogue;
use lockstep::participant::{ParameterError, Participant, Setup};

use crate::cli::{self, Cli, Command};
use crate::templates::Template;
use crate::{bench, catalogue, commands, limits, output, refusal, version};

/// A program with the whole command line, and with its own participants and assessments.
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
/// A scenario names such a participant as `run = { builtin = "lander" }`. It runs in a separate process, which is another
/// instance of this program, or with `--in-process` and in campaigns in this process.
pub struct Program {
    name: String,
    /// The program's own version; the version of Escapement is reported in addition.
    version: Option<String>,
    catalogue: Catalogue,
    templates: &'static [Template],
}

impl Program {
    /// A program without participants; `name` is shown on its help page.
    pub fn new(name: impl Into<String>) -> Program {
        Program {
            name: name.into(),
            version: None,
            catalogue: Catalogue::new(version::ESCAPEMENT),
            templates: &[],
        }
    }

    /// Sets the program's own version, which `--version` prints and `run.json` records: usually
    /// `env!("CARGO_PKG_VERSION")`.
    #[must_use]
    pub fn version(mut self, version: impl Into<String>) -> Program {
        self.version = Some(version.into());
        self
    }

    /// Adds project templates for `new`.
    #[cfg(feature = "capture")]
    #[must_use]
    pub(crate) fn templates(mut self, templates: &'static [Template]) -> Program {
        self.templates = templates;
        self
    }

    /// Adds a participant that scenarios name as `run = { builtin = "NAME" }`.
    #[must_use]
    pub fn participant(
        mut self,
        name: &str,
        make: impl Fn(&Setup) -> Result<Box<dyn Participant>, ParameterError> + Send + Sync + 'static,
    ) -> Program {
        self.catalogue = self.catalogue.participant(name, make);
        self
    }

    /// Adds other contents of a catalogue: assessments, warnings, findings, a list of failures, figures for reports.
    ///
    /// ```no_run
    /// use engine::Catalogue;
    /// use orchestrator::Program;
    ///
    /// fn contents(catalogue: Catalogue) -> Catalogue {
    ///     catalogue.warning(|scenario| vec![format!("`{}` was written in a hurry", scenario.title)])
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

    /// Parses the command line and executes the command.
    pub fn main(self) -> ExitCode {
        if let Some(missing) = engine::processor::missing() {
            eprintln!(
                "error: this program is compiled for x86-64-v3 processors (2013 and later) and this one lacks {missing}: remove the line \
                 `rustflags` from .cargo/config.toml and build again; results stay the same to the last bit, at a fraction of the speed"
            );
            return ExitCode::from(1);
        }
        // Clap requires texts with static lifetime, which the program leaks.
        let name: &'static str = self.name.leak();
        let version: &'static str = version::of_program(name, self.version.as_deref()).leak();
        let mut line = cli::command().name(name).bin_name(name).version(version);
        if self.templates.is_empty() {
            line = line.mut_subcommand("new", |new| new.hide(true));
        }
        let matches = line.clone().try_get_matches();
        let cli = match matches.and_then(|matches| Cli::from_arg_matches(&matches)) {
            Ok(cli) => cli,
            Err(answer) => return print_clap_answer(&answer),
        };
        let catalogue = self.catalogue.with_version(version);
        catalogue::set(bench::register(catalogue));
        execute(&cli.command, line, self.templates)
    }
}

fn execute(command: &Command, line: clap::Command, templates: &[Template]) -> ExitCode {
    limits::refuse_large_files();
    // A participant is a separate program that happens to share this file, and reports like one.
    if let Command::Participant(args) = command {
        return commands::participant::run(args);
    }
    limits::raise_open_files();
    // Full shared memory ends the run in order, not the program.
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
            // The worker's replies are for the program that started it.
            output::separate_stdout();
            let tasks = std::io::BufReader::new(std::io::stdin());
            engine::campaign::serve(catalogue::catalogue(), tasks, output::raw_stdout())
                .map(|()| 0)
                .map_err(Into::into)
        }
        Command::Participant(_) => Ok(0),
    };
    let stdout_error = output::stdout_error();
    let code = match result {
        Ok(code) => code,
        Err(error) => {
            let words = refusal::error_text(&error);
            // An error of the output is reported below.
            if stdout_error != Some(words.as_str()) {
                eprintln!("error: {words}");
            }
            refusal::exit_code(&error)
        }
    };
    match stdout_error {
        Some(reason) => report_incomplete_output(reason),
        None => ExitCode::from(code as u8),
    }
}

/// Prints the message of clap: help, the version, or a mistake in the command line.
fn print_clap_answer(answer: &clap::Error) -> ExitCode {
    match answer.print().and_then(|()| stdout().flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe && !answer.use_stderr() => {
            report_incomplete_output(&error.to_string())
        }
        _ => ExitCode::from(answer.exit_code() as u8),
    }
}

/// Reports that the output is incomplete, whatever the result.
fn report_incomplete_output(reason: &str) -> ExitCode {
    eprintln!("error: standard output cannot be written: {reason}");
    ExitCode::from(1)
}
