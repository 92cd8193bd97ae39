//! `escapement sweep SCENARIO`, and the commands for folders of campaigns: `run`, `merge`, `status`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::{ArgMatches, Args, FromArgMatches, Subcommand};
use engine::campaign::{self, AuditCoverage, Campaign, CampaignError, Merged, Options, Part, Source, State, Until};
use engine::scenario::Scenario;

use super::conclusion::{conclude, figures};
use super::points::{CampaignArgs, Ports, ShardArgs, TRIES_MAX, audit_without_second_shard, known_figures, watch};
use super::sweep::{self, SweepArgs};
use crate::catalogue::catalogue;

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
    /// Run the missing points of the campaign in a folder; the folder determines everything
    ///
    /// Exit codes: as those of `sweep`.
    Run(RunFolderArgs),
    /// Merge the folders of all shards into one campaign; the table is the one that a single machine computes, byte for byte
    ///
    /// Folders of other campaigns, scenarios or builds of the program are rejected, and so are points that are in two folders or in none, and
    /// points that were run twice with different results.
    ///
    /// Exit codes: 0 all points ran; 1 a point did not run to its end; 2 the folders do not form a complete campaign, nothing was written.
    Merge(MergeArgs),
    /// Report the progress of a campaign, from its folder or from those of its shards
    ///
    /// Exit codes: 0 all points have results; 1 points are missing or crashed; 2 it is not the folder of a campaign.
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

/// Arguments of `sweep run`.
#[derive(Debug, Args)]
pub struct RunFolderArgs {
    /// The folder of a campaign
    pub folder: PathBuf,
    /// Which part of the points
    #[command(flatten)]
    pub sharding: ShardArgs,
    /// How they are run
    #[command(flatten)]
    pub campaign: CampaignArgs,
}

/// Arguments of `sweep merge`.
#[derive(Debug, Args)]
pub struct MergeArgs {
    /// The folder to create
    #[arg(value_name = "OUT", conflicts_with = "out")]
    pub whole: PathBuf,
    /// The folders of all shards
    #[arg(required = true)]
    pub shards: Vec<PathBuf>,
    /// The figure of merit that the chart and the quantiles show, such as position_error_at_grasp
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

/// Executes the command and reports.
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

/// The command that continues a rare-event campaign: its file determines the next points.
fn rare_command(source: &Source, folder: &Path) -> String {
    format!("{} --out {}", source.file.0.display(), folder.display())
}

fn run_folder(args: &RunFolderArgs) -> Result<i32, CampaignError> {
    let (campaign, identity) = Campaign::of_folder(&args.folder)?;
    if let Some(source) = campaign.source.as_ref().filter(|source| source.rare) {
        return Err(CampaignError::Rare(format!(
            "{}: its points depend on those before them, which the campaign file says: sweep {}",
            args.folder.display(),
            rare_command(source, &args.folder)
        )));
    }
    let scenario = Scenario::changed(catalogue(), &campaign.scenario, &campaign.overrides)?;
    let options = args.sharding.options(args.campaign.options())?;
    // The rule is for the whole campaign: a shard does not know when all shards together have enough points.
    let until = identity.until.as_ref().filter(|_| args.sharding.shard.is_none());
    let watch = |until: &Until| watch(until, &known_figures(&campaign, TRIES_MAX, Ports::Queried)?);
    let shard = options.shard.or(identity.shard);
    let options = Options {
        until: until.map(watch).transpose()?,
        shard,
        // A bundle has the share, which is that of its shards.
        audit: args.sharding.audit.or(shard.map(|_| identity.audit)).unwrap_or(0.0),
        out: options
            .out
            .or_else(|| args.sharding.shard.is_none().then(|| args.folder.clone())),
        ..options
    };
    if args.sharding.audit.is_some() && options.shard.is_none_or(|shard| shard.of == 1) {
        return Err(audit_without_second_shard("all points in one folder"));
    }
    let finished = campaign::run_as(&identity, &campaign, &scenario, &options)?;
    conclude(&campaign, &finished, &figures(&finished), None, &args.campaign)
}

fn merge(args: &MergeArgs) -> Result<i32, CampaignError> {
    let Merged {
        campaign,
        mut finished,
        figure,
        audits,
    } = campaign::merge(&args.whole, &args.shards, args.figure.as_deref())?;
    let known = figures(&finished);
    if !args.campaign.keep.is_empty() {
        let scenario = Scenario::changed(catalogue(), &campaign.scenario, &campaign.overrides)?;
        let options = Options {
            figure: figure.clone(),
            ..args.campaign.options()
        };
        finished.keep(&campaign, &scenario, &options)?;
    }
    print_audits(&audits, &args.campaign);
    conclude(&campaign, &finished, &known, figure.as_ref(), &args.campaign)
}

/// Reports what was run twice, and warns where that is not a part of all folders.
fn print_audits(audits: &AuditCoverage, args: &CampaignArgs) {
    if audits.compared > 0 && !args.quiet && !args.json {
        let were = if audits.compared == 1 {
            "point was"
        } else {
            "points were"
        };
        println!("{} {were} run twice, with the same bits", audits.compared);
    }
    if !audits.without.is_empty() {
        let folders: Vec<String> = audits.without.iter().map(|root| root.display().to_string()).collect();
        eprintln!(
            "warning: {}: run without --audit, so that it repeats no points of the shard before it, and the machines of the two are not compared",
            folders.join(", ")
        );
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
            // Optional: the folders alone show the overall progress.
            eprintln!("warning: {error}");
            BTreeSet::new()
        }
        None => BTreeSet::new(),
    };
    let running = parts.iter().any(|part| matches!(part.state, State::Running(_)));
    // The folder of the whole waits for its shards.
    let waits = |shard: Option<usize>| match shard {
        Some(shard) => alive.contains(&shard),
        None => engine.is_some() && (running || !alive.is_empty()),
    };
    // Shards without a folder so far.
    let of = engine.as_ref().map_or(0, |engine| engine.of);
    let shards = parts.iter().any(|part| part.identity.shard.is_some());
    let whole = parts
        .iter()
        .any(|part| part.identity.shard.is_none() && part.state == State::Complete);
    // The folder of a shard may be removed when its results are in the whole.
    let unseen: Vec<usize> = (1..=of).filter(|shard| !whole && !known.contains(shard)).collect();
    // Shards that were not started are known where an engine has them, or by their points.
    let alone = parts.iter().any(|part| part.root == args.folder);
    let nowhere = if engine.is_some() || alone {
        0
    } else {
        campaign::unassigned_points(&parts)
    };
    let complete = unseen.is_empty() && nowhere == 0 && parts.iter().all(|part| part.state == State::Complete);
    let all = whole || (shards && complete);
    if args.json {
        let mut list: Vec<serde_json::Value> = parts.iter().map(|part| json(part, waits(part.number()))).collect();
        for shard in &unseen {
            let state = if waits(Some(*shard)) { "waiting" } else { "not started" };
            list.push(serde_json::json!({ "shard": format!("{shard}/{of}"), "done": 0, "state": state }));
        }
        let engine = engine.as_ref().map(|engine| engine.engine.name());
        println!(
            "{}",
            serde_json::json!({ "complete": all, "engine": engine, "parts": list, "in_no_folder": nowhere })
        );
        return Ok(i32::from(!all));
    }
    if let Some(first) = parts.first() {
        let on = engine
            .as_ref()
            .map(|engine| format!(", {} shards on {}", engine.of, engine.engine.name()));
        let on = on.unwrap_or_default();
        println!("{}: {} points{on}", first.identity.scenario, first.points);
    }
    for part in &parts {
        // The whole goes on with the command that gave its shards to the engine.
        print(part, waits(part.number()), engine.is_none() || part.number().is_some());
    }
    for shard in unseen {
        let state = if waits(Some(shard)) { "waiting" } else { "not started" };
        println!("  shard {shard}/{of}  {state}");
    }
    if nowhere > 0 {
        println!("  {nowhere} points are in none of these folders: start the shards that have them");
    }
    if engine.is_some() && !all {
        println!("  what is missing is given to the engine once more by the command that gave it");
    }
    Ok(i32::from(!all))
}

fn state_word(state: &State, waits: bool) -> &'static str {
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
        "crashed": part.crashed(),
        "running": part.running(),
        "outcomes": part.outcomes,
        "audits": [part.audits.0, part.audits.1],
        "until": part.identity.until,
        "enough": part.enough,
        "nodes": part.nodes,
        "state": state_word(&part.state, waits),
    })
}

/// `  shard 3/8  12 of 25 points, 1 failed, 1 crashed, 2 running (on n3)  running on n3, process 17  sweeps/…`
///
/// `alone` says that `sweep run` continues it.
fn print(part: &Part, waits: bool, alone: bool) {
    let name = part
        .identity
        .shard
        .map_or("all".to_owned(), |shard| format!("shard {shard}"));
    let mut counts = format!("{} of {} points", part.done(), part.own);
    let kinds = [
        (part.failed(), "failed"),
        (part.crashed(), "crashed"),
        (part.running(), "running"),
    ];
    for (count, what) in kinds {
        if count > 0 {
            counts += &format!(", {count} {what}");
        }
    }
    if part.audits.1 > 0 {
        counts += &format!(", {} of {} audited", part.audits.0, part.audits.1);
    }
    if let Some(until) = &part.identity.until {
        counts += &match part.enough {
            Some(enough) => format!(", the first {enough} are enough for `{until}`"),
            None => format!(", until `{until}`"),
        };
    }
    let nodes = match part.nodes.as_slice() {
        [] => String::new(),
        nodes => format!(" (on {})", nodes.join(", ")),
    };
    let state = match &part.state {
        State::Running(holder) => format!("running on {}, process {}", holder.node, holder.pid),
        state => state_word(state, waits).to_owned(),
    };
    println!("  {name}  {counts}{nodes}  {state}  {}", part.root.display());
    if part.is_outgrown() {
        let (had, has) = (part.identity.points, part.points);
        println!(
            "    was started for {had} points, and the campaign has {has}: goes on with the command of the larger campaign"
        );
    } else if part.state == State::Stopped && !waits && alone {
        let source = part.identity.source.as_ref().filter(|source| source.rare);
        let command = source.map_or_else(
            || format!("run {}", part.root.display()),
            |source| rare_command(source, &part.root),
        );
        println!("    continue with: sweep {command}");
    }
}
