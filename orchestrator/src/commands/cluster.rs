//! Campaigns on other machines: submitted to an engine, or written as a bundle.

use std::path::PathBuf;

use clap::Args;
use engine::campaign::{self, Campaign, CampaignError, Cluster, Engine, Number, Options, Step, SubmittedShards};
use engine::scenario::Scenario;

use super::conclusion::{conclude, figures};
use super::points::{CampaignArgs, audit_without_second_shard};
use crate::catalogue::catalogue;

/// On which machines.
#[derive(Debug, Args)]
pub struct ClusterArgs {
    /// Run the shards on other machines through an engine: shell prints a command line for each shard; slurm and hyperqueue receive jobs. The
    /// same command again submits what is missing, and writes the table when all shards are complete
    #[arg(long, value_name = "ENGINE", conflicts_with_all = ["shard", "keep", "json"])]
    pub on: Option<Engine>,
    /// The number of shards; by default as many as before, or 16
    #[arg(long, value_name = "COUNT", requires = "on", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub shards: Option<u32>,
    /// Options for the engine, such as '--partition=long --time=2:00:00' (may be given more than once)
    #[arg(long, value_name = "OPTIONS", requires = "on", allow_hyphen_values = true)]
    pub engine_args: Vec<String>,
    /// Write the campaign with all files that it needs to this new folder, and run nothing: `sweep run` runs it on any machine
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["on", "shard", "keep", "out", "json", "figure", "workers", "lanes"])]
    pub bundle: Option<PathBuf>,
    /// Add this file or folder to the bundle (may be given more than once)
    #[arg(long, value_name = "PATH")]
    pub include: Vec<PathBuf>,
}

impl ClusterArgs {
    /// Executes the options; `None` when the campaign is to run on this machine.
    ///
    /// # Errors
    /// An error of the engine or the file system.
    pub fn submit_or_bundle(
        &self,
        campaign: &Campaign,
        scenario: &Scenario,
        options: &Options,
        figure: Option<&Number>,
        args: &CampaignArgs,
    ) -> Result<Option<i32>, CampaignError> {
        if let Some(folder) = &self.bundle {
            let made = campaign::bundle(folder, catalogue(), campaign, scenario, options, &self.include)?;
            print_warnings(&made.left);
            if !args.quiet {
                println!("{} points", made.identity.points);
                println!("{}", made.root.display());
            }
            return Ok(Some(0));
        }
        let unused = |reason: &str| Err(CampaignError::Merge(reason.to_owned()));
        let Some(engine) = self.on else {
            if !self.include.is_empty() {
                return unused("--include: a file comes along in a bundle, so say where with --bundle or --on");
            }
            if options.audit > 0.0 && options.shard.is_none() {
                let reason = "--audit: a point is run twice in two shards; say which with --shard, or where with --on";
                return Err(CampaignError::Merge(reason.into()));
            }
            return Ok(None);
        };
        if options.audit > 0.0 && self.shards == Some(1) {
            return Err(audit_without_second_shard("--shards 1"));
        }
        if engine == Engine::Shell && !self.engine_args.is_empty() {
            return unused("--engine-args: the engine shell prints command lines and has no options");
        }
        let cluster = Cluster {
            engine,
            shards: self.shards.map(|count| count as usize),
            args: self.engine_args.iter().flat_map(|text| split_words(text)).collect(),
            include: self.include.clone(),
        };
        match campaign::submit(catalogue(), campaign, scenario, options, &cluster)? {
            Step::Given(underway) => print_submission(engine, &underway, args).map(|()| Some(0)),
            Step::Complete(finished) => conclude(campaign, &finished, &figures(&finished), figure, args).map(Some),
        }
    }
}

/// Reports a submission to an engine.
fn print_submission(engine: Engine, underway: &SubmittedShards, args: &CampaignArgs) -> Result<(), CampaignError> {
    let SubmittedShards {
        root,
        lines,
        jobs,
        alive,
        left,
    } = underway;
    print_warnings(left);
    if engine == Engine::Shell {
        lines.iter().for_each(|line| println!("{line}"));
        return Ok(());
    }
    if !args.quiet {
        println!(
            "{}: {} shards given in jobs {}, {alive} waiting or running",
            engine.version()?,
            lines.len(),
            jobs.join(", ")
        );
        println!("how far it is: sweep status {}", root.display());
    }
    Ok(())
}

fn print_warnings(left: &[String]) {
    left.iter().for_each(|what| eprintln!("warning: {what}"));
}

/// Splits `text` into words; quotes group words with blanks.
fn split_words(text: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), None::<String>, None);
    for letter in text.chars() {
        match quote {
            Some(mark) if letter == mark => quote = None,
            None if letter == '"' || letter == '\'' => {
                quote = Some(letter);
                word.get_or_insert_default();
            }
            None if letter.is_whitespace() => words.extend(word.take()),
            _ => word.get_or_insert_default().push(letter),
        }
    }
    words.extend(word);
    words
}
