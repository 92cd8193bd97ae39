//! Submission of the missing shards of a campaign to an engine.

use std::collections::{BTreeMap, BTreeSet};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::engine::Engine;
use super::job::{Job, JobRequest};
use crate::Catalogue;
use crate::campaign::folder::campaign_folder::Folder;
use crate::campaign::folder::identity::{Identity, io_error};
use crate::campaign::folder::status::{State, parts};
use crate::campaign::shards::bundle::{Bundle, bundle};
use crate::campaign::shards::shard::Shard;
use crate::campaign::{Campaign, CampaignError, Finished, Options};
use crate::scenario::Scenario;

/// Where and how the shards run.
#[derive(Debug, Clone)]
pub struct Cluster {
    /// The engine.
    pub engine: Engine,
    /// Number of shards; unless given, the previous number, or sixteen.
    pub shards: Option<usize>,
    /// The user's options for the engine.
    pub args: Vec<String>,
    /// Files and folders that the scenario needs and does not name.
    pub include: Vec<PathBuf>,
}

/// Shards that were submitted to the engine, or are still with it.
#[derive(Debug)]
pub struct SubmittedShards {
    /// The campaign's folder.
    pub root: PathBuf,
    /// The command line of each submitted shard.
    pub lines: Vec<String>,
    /// The engine's identifiers of the jobs.
    pub jobs: Vec<String>,
    /// Number of shards that were already with it.
    pub alive: usize,
    /// Dependencies that every machine must have.
    pub left: Vec<String>,
}

/// The result of a submission.
pub(super) enum Submission {
    /// Shards are running or waiting.
    Submitted(SubmittedShards),
    /// All shards are complete: the folders to be merged.
    Complete {
        /// The campaign's folder.
        root: PathBuf,
        /// The folders of the shards.
        shards: Vec<PathBuf>,
    },
    /// The campaign's folder has all results: they were merged before.
    Merged(Box<Finished>),
}

/// `engine.json`: the engine's record in the campaign's folder.
#[derive(Debug, Serialize, Deserialize)]
struct EngineRecord {
    engine: Engine,
    version: String,
    /// Number of shards.
    of: usize,
    args: Vec<String>,
    /// The share of the points that is run twice.
    audit: f64,
    jobs: Vec<Job>,
}

impl EngineRecord {
    fn read(root: &Path) -> Result<Option<EngineRecord>, CampaignError> {
        let path = root.join("engine.json");
        match std::fs::read(&path) {
            Ok(text) => serde_json::from_slice(&text)
                .map(Some)
                .map_err(|error| io_error(&path, "read the file")(error.into())),
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(io_error(&path, "read the file")(error)),
        }
    }

    fn write(&self, root: &Path) -> Result<(), CampaignError> {
        let path = root.join("engine.json");
        let text =
            serde_json::to_string_pretty(self).map_err(|error| io_error(&path, "write the file")(error.into()))? + "\n";
        tape::write_atomic(&path, text).map_err(io_error(&path, "write the file"))
    }

    /// Number of shards of the jobs.
    fn shards(&self) -> usize {
        self.jobs.iter().map(|job| job.shards.len()).sum()
    }

    /// Submits these shards of the campaign in `root`; returns the engine's names of the jobs.
    fn start_jobs(
        &mut self,
        root: &Path,
        name: &str,
        script: &Path,
        shards: &[usize],
    ) -> Result<Vec<String>, CampaignError> {
        let mut jobs = Vec::new();
        for shards in shards.chunks(self.engine.job_size_max()?) {
            let request = JobRequest {
                root,
                name,
                script: script.to_owned(),
                shards,
                args: &self.args,
            };
            let job = self.engine.start(&request);
            let job = job.map_err(|error| mention_accepted(error, self.shards()))?;
            jobs.push(job.id.clone());
            self.jobs.push(job);
            self.write(root)?;
        }
        self.write(root)?;
        Ok(jobs)
    }

    /// The shards that wait or run.
    fn active_shards(&self) -> Result<BTreeSet<usize>, CampaignError> {
        let mut alive = BTreeSet::new();
        for job in &self.jobs {
            alive.extend(self.engine.active_shards(job, &self.args)?);
        }
        Ok(alive)
    }
}

/// The engine state of the campaign in `root`; `None` where it uses no engine.
#[derive(Debug)]
pub struct Waiting {
    /// The engine.
    pub engine: Engine,
    /// Number of shards.
    pub of: usize,
    /// The shards that wait or run, or the reason why the engine does not report them.
    pub alive: Result<BTreeSet<usize>, CampaignError>,
}

/// Queries the engine of the campaign in `root`.
///
/// # Errors
/// When the folder cannot be read.
pub fn waiting(root: &Path) -> Result<Option<Waiting>, CampaignError> {
    let record = EngineRecord::read(root)?;
    Ok(record.map(|record| Waiting {
        engine: record.engine,
        of: record.of,
        alive: record.active_shards(),
    }))
}

/// A path, quoted for a shell.
fn shell_quoted(path: &Path) -> String {
    format!(
        "'{}'",
        String::from_utf8_lossy(path.as_os_str().as_bytes()).replace('\'', "'\\''")
    )
}

/// The absolute path of the folder of `campaign`.
pub(super) fn campaign_root(
    campaign: &Campaign,
    identity: &Identity,
    options: &Options,
) -> Result<PathBuf, CampaignError> {
    let root = Folder::path_of(campaign, identity, options);
    std::path::absolute(&root).map_err(io_error(&root, "find the folder"))
}

/// Submits to the engine the shards of `campaign` that are missing and not yet with it.
///
/// # Errors
/// When the folder belongs to something else, or the engine refuses. The next call knows the shards that the engine had
/// accepted before the error.
pub(super) fn submit_missing(
    catalogue: &Arc<Catalogue>,
    campaign: &Campaign,
    scenario: &Scenario,
    options: &Options,
    cluster: &Cluster,
) -> Result<Submission, CampaignError> {
    let started = Instant::now();
    let version = cluster.engine.version()?;
    let identity = Identity::of(campaign, scenario)?;
    let root = campaign_root(campaign, &identity, options)?;
    // Held to the end: two processes that submit the same shards would run them twice.
    let (folder, known) = Folder::lock_at(&root, campaign, &identity)?;
    let before = EngineRecord::read(&root)?;
    let audit_before = before.as_ref().map(|record| record.audit);
    let mut record = cluster.with_previous(before, campaign.points.len(), options.audit, &root)?;
    record.version = version;
    let of = record.of;
    let alive = record.active_shards()?;
    // Jobs that have ended are not queried again.
    record
        .jobs
        .retain(|job| job.shards.iter().any(|shard| alive.contains(shard)));
    let state = ShardStates::read(&root, &identity, of, record.audit)?;
    if state.complete.len() == of {
        drop(folder);
        let shards = state.complete.into_values().collect();
        return Ok(Submission::Complete { root, shards });
    }
    // Whether the folders of the shards are still there or not.
    let is_merged = audit_before == Some(record.audit) && known.results.iter().all(Option::is_some);
    if is_merged && alive.is_empty() && state.running.is_empty() {
        return Ok(Submission::Merged(Box::new(Finished {
            folder,
            identity,
            resumed: known.results.len(),
            results: known.results,
            interrupted: false,
            wall_s: started.elapsed().as_secs_f64(),
        })));
    }
    let is_submitted =
        |shard: &usize| alive.contains(shard) || state.running.contains(shard) || state.complete.contains_key(shard);
    let missing: Vec<usize> = (1..=of).filter(|shard| !is_submitted(shard)).collect();
    let already_submitted = of - missing.len() - state.complete.len();
    let bundle = match existing_bundle(&root, &identity) {
        Some(bundle) => bundle,
        None if already_submitted > 0 => {
            let reason = "has shards that are with the engine or run: wait for their end before the campaign becomes another one";
            return cluster.engine.refuse(format!("{} {reason}", root.display()));
        }
        None => bundle(
            &root.join("bundle"),
            catalogue,
            campaign,
            scenario,
            options,
            &cluster.include,
        )?,
    };
    let script = script(&root, &bundle, of, record.audit, options)?;
    let jobs = record.start_jobs(&root, &identity.scenario, &script, &missing)?;
    Ok(Submission::Submitted(SubmittedShards {
        lines: missing
            .iter()
            .map(|shard| format!("{} {shard}", shell_quoted(&script)))
            .collect(),
        root,
        jobs,
        alive: already_submitted,
        left: bundle.left,
    }))
}

/// The error of an engine that had accepted `count` shards before.
fn mention_accepted(error: CampaignError, count: usize) -> CampaignError {
    match error {
        CampaignError::Engine { engine, reason } if count > 0 => {
            let reason = format!("{reason}; it has {count} shards already: the same command later gives it the others");
            CampaignError::Engine { engine, reason }
        }
        error => error,
    }
}

impl Cluster {
    /// The submission options for the folder `root`; options that the user leaves out keep their value in `before`.
    fn with_previous(
        &self,
        before: Option<EngineRecord>,
        points: usize,
        audit: f64,
        root: &Path,
    ) -> Result<EngineRecord, CampaignError> {
        let of = self.shards.or(before.as_ref().map(|record| record.of));
        let mut record = EngineRecord {
            engine: self.engine,
            version: String::new(),
            of: of.unwrap_or(16).min(points.max(1)),
            args: self.args.clone(),
            audit,
            jobs: Vec::new(),
        };
        let Some(before) = before else {
            return Ok(record);
        };
        if (before.engine, before.of) != (record.engine, record.of) {
            let (had, of) = (before.engine.name(), before.of);
            return self.engine.refuse(format!(
                "{} has {of} shards on {had}: go on with --on {had} --shards {of}, or name another folder with --out",
                root.display(),
            ));
        }
        record.jobs = before.jobs;
        if audit == 0.0 {
            record.audit = before.audit;
        }
        if record.args.is_empty() {
            record.args = before.args;
        }
        Ok(record)
    }
}

/// The existing bundle, if it is of this campaign. It is not changed: shards may run from it.
fn existing_bundle(root: &Path, identity: &Identity) -> Option<Bundle> {
    let root = root.join("bundle");
    let known = Identity::read(&root)
        .ok()
        .filter(|known| known.digest == identity.digest)?;
    let program = std::fs::read_dir(root.join("bin")).ok()?.next()?.ok()?.path();
    Some(Bundle {
        root,
        program,
        identity: known,
        left: Vec::new(),
    })
}

/// Writes the script that runs shard K as `shard.sh K`.
fn script(root: &Path, bundle: &Bundle, of: usize, audit: f64, options: &Options) -> Result<PathBuf, CampaignError> {
    let audit = match audit {
        0.0 => String::new(),
        share => format!(" --audit {}%", 100.0 * share),
    };
    let text = format!(
        "#!/bin/sh\n# Runs shard $1 of this campaign. Started again it goes on where it was.\n\
         exec {} sweep run {} --shard \"$1/{of}\"{audit} --out {}/\"$1-of-{of}\" --workers {} --quiet\n",
        shell_quoted(&bundle.program),
        shell_quoted(&bundle.root),
        shell_quoted(&root.join("shards")),
        options.workers.unwrap_or(1),
    );
    let path = root.join("shard.sh");
    tape::write_atomic(&path, text).map_err(io_error(&path, "write the file"))?;
    let mode = std::fs::Permissions::from_mode(0o755);
    std::fs::set_permissions(&path, mode).map_err(io_error(&path, "make the file executable"))?;
    Ok(path)
}

/// State of the shards' folders.
#[derive(Default)]
struct ShardStates {
    /// Shards that are being run, whether the engine knows of them or not.
    running: BTreeSet<usize>,
    /// The folders of complete shards.
    complete: BTreeMap<usize, PathBuf>,
}

impl ShardStates {
    fn read(root: &Path, identity: &Identity, of: usize, audit: f64) -> Result<ShardStates, CampaignError> {
        let mut shards = ShardStates::default();
        for part in parts(root)? {
            let Some(Shard { number, .. }) = part.identity.shard.filter(|shard| shard.of == of) else {
                continue;
            };
            // A folder with fewer points, or with other audits, has points to run.
            let whole = part.identity.digest == identity.digest && part.identity.audit == audit;
            match part.state {
                State::Running(_) => {
                    shards.running.insert(number);
                }
                // Points that crashed are not submitted again: they may crash each time.
                State::Complete | State::Stopped if whole && part.is_run() => {
                    shards.complete.insert(number, part.root);
                }
                State::Complete | State::Stopped => {}
            }
        }
        Ok(shards)
    }
}
