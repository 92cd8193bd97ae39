//! `escapement sweep SCENARIO`, and what is done with the folders of campaigns: `run`, `merge`, `status`

use std::collections::BTreeSet;
use std::path::PathBuf;

use clap::{ArgMatches, Args, FromArgMatches, Subcommand};
use engine::campaign::{
    self, Campaign, CampaignError, Cluster, Engine, Finished, Keep, Number, Options, Part, Shard, State, Step,
};
use engine::scenario::Scenario;

use super::conclusion::{self, conclude, told};
use super::sweep::{self, CampaignArgs, SweepArgs};
use crate::program::catalogue;

/// A campaign, or something to be done with one that is there.
#[derive(Debug)]
pub enum SweepCommand {
    /// A scenario and what is varied.
    Campaign(Box<SweepArgs>),
    /// Folders.
    Action(SweepAction),
}

/// What is done with folders of campaigns.
#[derive(Debug, Subcommand)]
pub enum SweepAction {
    /// Run the points that a campaign's folder lacks, with nothing but the folder to say what they are
    ///
    /// Exit codes: as those of `sweep`.
    Run(RunFolderArgs),
    /// Make one campaign of the folders of all of its shards: the table that one machine gives, byte for byte
    ///
    /// Refused are folders of other campaigns, scenarios or builds of the program, points that are in two folders or in none, and points that
    /// were run twice with other bits the second time.
    ///
    /// Exit codes: 0 all points ran; 1 a point did not run to its end; 2 the folders do not make a whole, nothing was written.
    Merge(MergeArgs),
    /// Say how far a campaign is: its folder, or those of its shards
    ///
    /// Exit codes: 0 all points have results; 1 points are missing; 2 it is no campaign's folder.
    Status(StatusArgs),
}

impl Args for SweepCommand {
    fn augment_args(command: clap::Command) -> clap::Command {
        let command = SweepAction::augment_subcommands(SweepArgs::augment_args(command));
        command
            .subcommand_required(false)
            .arg_required_else_help(false)
            .subcommand_negates_reqs(true)
            .args_conflicts_with_subcommands(true)
    }

    fn augment_args_for_update(command: clap::Command) -> clap::Command {
        SweepCommand::augment_args(command)
    }
}

impl FromArgMatches for SweepCommand {
    fn from_arg_matches(matches: &ArgMatches) -> Result<SweepCommand, clap::Error> {
        if matches.subcommand_name().is_some() {
            return SweepAction::from_arg_matches(matches).map(SweepCommand::Action);
        }
        SweepArgs::from_arg_matches(matches).map(|args| SweepCommand::Campaign(Box::new(args)))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = SweepCommand::from_arg_matches(matches)?;
        Ok(())
    }
}

/// Which part of the points.
#[derive(Debug, Args)]
pub struct PartArgs {
    /// Run every N-th point alone, from point K on, into a folder of its own; `sweep merge` makes one campaign of all N
    #[arg(long, value_name = "K/N")]
    pub shard: Option<Shard>,
    /// Run this share of the points a second time in the shard after their own, such as 1%: `sweep merge` then names nodes whose bits differ
    #[arg(long, value_name = "SHARE", value_parser = share)]
    pub audit: Option<f64>,
}

/// A share of the points, for an option.
fn share(text: &str) -> Result<f64, String> {
    let wrong = || format!("`{text}` is no share: write one above 0 % and up to 100 %, such as 1%");
    let percent: f64 = text
        .trim()
        .strip_suffix('%')
        .and_then(|number| number.trim().parse().ok())
        .ok_or_else(wrong)?;
    (percent > 0.0 && percent <= 100.0)
        .then_some(percent / 100.0)
        .ok_or_else(wrong)
}

/// On which machines.
#[derive(Debug, Args)]
pub struct ClusterArgs {
    /// Let an engine run the shards on other machines: shell prints a command line for each, slurm and hyperqueue get jobs. The same command
    /// again gives what is missing once more, and makes the table when all are complete
    #[arg(long, value_name = "ENGINE", conflicts_with_all = ["shard", "keep", "until", "json"])]
    pub on: Option<Engine>,
    /// How many shards; as many as before when not given, or 16
    #[arg(long, value_name = "COUNT", requires = "on", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub shards: Option<u32>,
    /// Options for the engine, such as '--partition=long --time=2:00:00' (may be given more than once)
    #[arg(long, value_name = "OPTIONS", requires = "on", allow_hyphen_values = true)]
    pub engine_args: Vec<String>,
    /// Write the campaign with everything that it needs to this new folder, and run nothing: `sweep run` runs it wherever it is copied to
    #[arg(long, value_name = "FOLDER", conflicts_with_all = ["on", "shard"])]
    pub bundle: Option<PathBuf>,
    /// Take this file or folder into the bundle too (may be given more than once)
    #[arg(long, value_name = "PATH")]
    pub include: Vec<PathBuf>,
}

impl ClusterArgs {
    /// Does what was asked for; `None` when the campaign is to be run here.
    ///
    /// # Errors
    /// What the engine or the file system refuses.
    pub fn act(
        &self,
        campaign: &Campaign,
        scenario: &Scenario,
        options: &Options,
        figure: Option<&Number>,
        how: &CampaignArgs,
    ) -> Result<Option<i32>, CampaignError> {
        if let Some(folder) = &self.bundle {
            let made = campaign::bundle(folder, catalogue(), campaign, scenario, &self.include)?;
            warn(&made.left);
            if !how.quiet {
                println!("{} points", made.identity.points);
                println!("{}", made.root.display());
            }
            return Ok(Some(0));
        }
        let Some(engine) = self.on else {
            if options.audit > 0.0 && options.shard.is_none() {
                let reason = "--audit: a point is run twice in two shards; say which with --shard, or where with --on";
                return Err(CampaignError::Merge(reason.into()));
            }
            return Ok(None);
        };
        let cluster = Cluster {
            engine,
            shards: self.shards.map(|count| count as usize),
            args: self.engine_args.iter().flat_map(|text| words(text)).collect(),
            include: self.include.clone(),
        };
        let step = campaign::submit(catalogue(), campaign, scenario, options, &cluster)?;
        if let Step::Complete { root, shards } = &step {
            let (campaign, finished) = campaign::merge(root, shards)?;
            return conclude(&campaign, &finished, &figures(&finished), figure, how).map(Some);
        }
        given(engine, &step, how)?;
        Ok(Some(0))
    }
}

/// What was given to an engine.
fn given(engine: Engine, step: &Step, how: &CampaignArgs) -> Result<(), CampaignError> {
    let Step::Given {
        root,
        lines,
        jobs,
        alive,
        left,
    } = step
    else {
        return Ok(());
    };
    warn(left);
    if engine == Engine::Shell {
        lines.iter().for_each(|line| println!("{line}"));
        return Ok(());
    }
    if !how.quiet {
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

fn warn(left: &[String]) {
    left.iter().for_each(|what| eprintln!("warning: {what}"));
}

/// The words of `text`; quotes hold together what has blanks.
fn words(text: &str) -> Vec<String> {
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

impl PartArgs {
    /// `options` for that part.
    ///
    /// # Errors
    /// When something is wanted that only the whole campaign knows.
    pub fn options(&self, options: Options) -> Result<Options, CampaignError> {
        if self.shard.is_some() && options.keep.iter().any(|keep| matches!(keep, Keep::Worst(_))) {
            return Err(CampaignError::Merge(
                "--keep worst: a shard does not know which points are the worst; give it to `sweep merge`".into(),
            ));
        }
        Ok(Options {
            shard: self.shard,
            audit: self.audit.unwrap_or(0.0),
            ..options
        })
    }
}

/// Arguments of `sweep run`.
#[derive(Debug, Args)]
pub struct RunFolderArgs {
    /// The folder of a campaign
    pub folder: PathBuf,
    /// Which part of the points
    #[command(flatten)]
    pub part: PartArgs,
    /// How they are run
    #[command(flatten)]
    pub campaign: CampaignArgs,
}

/// Arguments of `sweep merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// The folder to make
    #[arg(value_name = "OUT", conflicts_with = "out")]
    pub whole: PathBuf,
    /// The folders of all shards
    #[arg(required = true)]
    pub shards: Vec<PathBuf>,
    /// The figure of merit that the picture and the quantiles show, such as position_error_at_grasp
    #[arg(long, value_name = "NAME")]
    pub figure: Option<String>,
    /// How points are run whose folders are kept, and what is printed
    #[command(flatten)]
    pub campaign: CampaignArgs,
}

/// Arguments of `sweep status`.
#[derive(Debug, Args)]
pub struct StatusArgs {
    /// The folder of a campaign, of one of its shards, or one with folders of shards
    pub folder: PathBuf,
    /// Print the result as JSON
    #[arg(long)]
    pub json: bool,
}

/// Does it and reports.
pub fn run(command: &SweepCommand) -> anyhow::Result<i32> {
    let done = match command {
        SweepCommand::Campaign(args) => return sweep::run(args),
        SweepCommand::Action(SweepAction::Run(args)) => run_folder(args),
        SweepCommand::Action(SweepAction::Merge(args)) => merge(args),
        SweepCommand::Action(SweepAction::Status(args)) => status(args),
    };
    Ok(done.unwrap_or_else(|error| {
        eprintln!("error: {error}");
        error.exit_code()
    }))
}

fn run_folder(args: &RunFolderArgs) -> Result<i32, CampaignError> {
    let (campaign, identity) = Campaign::of_folder(&args.folder)?;
    let scenario = Scenario::read(catalogue(), &campaign.scenario, &campaign.overrides)?;
    let options = args.part.options(args.campaign.options())?;
    let options = Options {
        shard: options.shard.or(identity.shard),
        audit: args.part.audit.unwrap_or(identity.audit),
        out: options
            .out
            .or_else(|| args.part.shard.is_none().then(|| args.folder.clone())),
        ..options
    };
    let finished = campaign::run_as(&identity, &campaign, &scenario, &options)?;
    conclude(&campaign, &finished, &figures(&finished), None, &args.campaign)
}

/// The figures of merit that the points have.
fn figures(finished: &Finished) -> Vec<Number> {
    let mut all = finished.results.iter().flatten();
    let first = all.find_map(|result| result.figures.as_ref());
    first.map_or(Vec::new(), |figures| figures.ordered())
}

fn merge(args: &MergeArgs) -> Result<i32, CampaignError> {
    let (campaign, mut finished) = campaign::merge(&args.whole, &args.shards)?;
    let known = figures(&finished);
    let figure = match &args.figure {
        Some(name) => Some(campaign::figure_of(name, &known)?),
        None => None,
    };
    if !args.campaign.keep.is_empty() {
        let scenario = Scenario::read(catalogue(), &campaign.scenario, &campaign.overrides)?;
        let options = Options {
            figure: figure.clone(),
            ..args.campaign.options()
        };
        finished.keep(&campaign, &scenario, &options)?;
    }
    conclude(&campaign, &finished, &known, figure.as_ref(), &args.campaign)
}

/// What became of a part of a campaign.
pub fn print_part(title: &str, shard: Shard, campaign: &Campaign, finished: &Finished, how: &CampaignArgs) {
    if how.json {
        println!("{}", conclusion::json(campaign, finished, &[]));
    } else if !how.quiet {
        println!("{title}, shard {shard}");
        let own = finished
            .results
            .iter()
            .enumerate()
            .filter(|(at, _)| finished.identity.owns(*at));
        let own: Vec<_> = own.map(|(_, result)| result.clone()).collect();
        println!("{}", campaign::verdicts(&own));
        told(finished, &[finished.folder.root().to_owned()]);
    }
}

fn status(args: &StatusArgs) -> Result<i32, CampaignError> {
    let parts = campaign::parts(&args.folder)?;
    let engine = campaign::waiting(&args.folder)?;
    let known: BTreeSet<usize> = parts
        .iter()
        .filter_map(|part| Some(part.identity.shard?.number))
        .collect();
    let alive = match engine.as_ref().map(|engine| &engine.alive) {
        Some(Ok(alive)) => alive.clone(),
        Some(Err(error)) => {
            // The folders say how far all is without it.
            eprintln!("warning: {error}");
            BTreeSet::new()
        }
        None => BTreeSet::new(),
    };
    let waits = |shard: Option<usize>| shard.is_some_and(|shard| alive.contains(&shard));
    // Shards that have no folder yet.
    let of = engine.as_ref().map_or(0, |engine| engine.of);
    let unseen: Vec<usize> = (1..=of).filter(|shard| !known.contains(shard)).collect();
    let shards = parts.iter().any(|part| part.identity.shard.is_some());
    let whole = parts
        .iter()
        .any(|part| part.identity.shard.is_none() && part.state == State::Complete);
    let all = whole || (shards && unseen.is_empty() && parts.iter().all(|part| part.state == State::Complete));
    if args.json {
        let mut list: Vec<serde_json::Value> = parts.iter().map(|part| json(part, waits(part.number()))).collect();
        for shard in &unseen {
            let state = if waits(Some(*shard)) { "waiting" } else { "not started" };
            list.push(serde_json::json!({ "shard": format!("{shard}/{of}"), "done": 0, "state": state }));
        }
        let engine = engine.as_ref().map(|engine| engine.engine.word());
        println!(
            "{}",
            serde_json::json!({ "complete": all, "engine": engine, "parts": list })
        );
        return Ok(i32::from(!all));
    }
    if let Some(first) = parts.first() {
        let on = engine
            .as_ref()
            .map(|engine| format!(", {} shards on {}", engine.of, engine.engine.word()));
        let on = on.unwrap_or_default();
        println!("{}: {} points{on}", first.identity.scenario, first.identity.points);
    }
    parts.iter().for_each(|part| print(part, waits(part.number())));
    for shard in unseen {
        let state = if waits(Some(shard)) { "waiting" } else { "not started" };
        println!("  shard {shard}/{of}  {state}");
    }
    if engine.is_some() && !all {
        println!("  what is missing is given to the engine once more by the command that gave it");
    }
    Ok(i32::from(!all))
}

fn word(state: &State, waits: bool) -> &'static str {
    match state {
        State::Complete => "complete",
        State::Running(_) => "running",
        State::Stopped if waits => "waiting",
        State::Stopped => "stopped",
    }
}

fn json(part: &Part, waits: bool) -> serde_json::Value {
    serde_json::json!({
        "folder": part.root.display().to_string(),
        "shard": part.identity.shard.map(|shard| shard.to_string()),
        "points": part.own,
        "done": part.done(),
        "failed": part.failed(),
        "running": part.running(),
        "outcomes": part.outcomes,
        "audits": [part.audits.0, part.audits.1],
        "nodes": part.nodes,
        "state": word(&part.state, waits),
    })
}

/// `  shard 3/8  12 of 25 points, 1 failed, 2 running (on n3)  running on n3, process 17  sweeps/…`
fn print(part: &Part, waits: bool) {
    let name = part
        .identity
        .shard
        .map_or("all".to_owned(), |shard| format!("shard {shard}"));
    let mut counts = format!("{} of {} points", part.done(), part.own);
    for (count, what) in [(part.failed(), "failed"), (part.running(), "running")] {
        if count > 0 {
            counts += &format!(", {count} {what}");
        }
    }
    if part.audits.1 > 0 {
        counts += &format!(", {} of {} audited", part.audits.0, part.audits.1);
    }
    let nodes = match part.nodes.as_slice() {
        [] => String::new(),
        nodes => format!(" (on {})", nodes.join(", ")),
    };
    let state = match &part.state {
        State::Running(holder) => format!("running on {}, process {}", holder.node, holder.pid),
        state => word(state, waits).to_owned(),
    };
    println!("  {name}  {counts}{nodes}  {state}  {}", part.root.display());
    if part.state == State::Stopped && !waits {
        println!("    goes on with: sweep run {}", part.root.display());
    }
}
