//! Slurm: `sbatch --array`; the array index selects a line of a list of shards.

use std::collections::BTreeSet;
use std::process::Command;

use super::engine::{Engine, last_line};
use super::job::{Job, JobRequest};
use crate::campaign::CampaignError;
use crate::campaign::folder::identity::io_error;

const REMEDY: &str = "start it on a machine of the cluster that has Slurm's commands in PATH";

fn run_command(program: &str, args: &[&str]) -> Result<std::process::Output, CampaignError> {
    Engine::Slurm.run_command(Command::new(program).args(args), REMEDY)
}

pub fn version() -> Result<String, CampaignError> {
    let output = run_command("sbatch", &["--version"])?;
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// `MaxArraySize` of the cluster: array indices must be smaller.
pub fn array_max() -> Result<usize, CampaignError> {
    let output = run_command("scontrol", &["show", "config"])?;
    if !output.status.success() {
        return Engine::Slurm.refuse(format!("the cluster does not answer: {}", last_line(&output)));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let line = text.lines().find_map(|line| line.trim().strip_prefix("MaxArraySize"));
    let value = line.and_then(|line| line.trim_start_matches([' ', '=']).trim().parse().ok());
    Ok(value.unwrap_or(1001).max(1))
}

pub fn start(request: &JobRequest<'_>) -> Result<String, CampaignError> {
    let first = request.shards.first().copied().unwrap_or(0);
    let log = request.root.join("log");
    std::fs::create_dir_all(&log).map_err(io_error(&log, "create the folder"))?;
    let list = request
        .root
        .join(format!("slurm-{first}-{}.list", request.shards.len()));
    let lines: String = request.shards.iter().map(|shard| format!("{shard}\n")).collect();
    tape::write_atomic(&list, lines).map_err(io_error(&list, "write the file"))?;
    let script = request.root.join("slurm.sh");
    let text = "#!/bin/sh\n# A task of a job array: the line with its number in the list is its shard.\n\
                exec \"$1\" \"$(sed -n \"$((SLURM_ARRAY_TASK_ID + 1))p\" \"$2\")\"\n";
    tape::write_atomic(&script, text).map_err(io_error(&script, "write the file"))?;
    let mut command = Command::new("sbatch");
    command
        .args(["--parsable", "--job-name"])
        .arg(request.name)
        .arg(format!("--array=0-{}", request.shards.len() - 1))
        .arg("--output")
        .arg(log.join("%A_%a.txt"))
        .args(request.args)
        .args([&script, &request.script, &list]);
    let output = Engine::Slurm.run_command(&mut command, REMEDY)?;
    if !output.status.success() {
        return Engine::Slurm.refuse(format!("sbatch refuses the job: {}", last_line(&output)));
    }
    // `ID` or `ID;CLUSTER`
    let text = String::from_utf8_lossy(&output.stdout);
    Ok(text.trim().split(';').next().unwrap_or_default().to_owned())
}

pub fn active_shards(job: &Job) -> Result<BTreeSet<usize>, CampaignError> {
    let output = run_command("squeue", &["--noheader", "--array", "--format=%K", "--jobs", &job.id])?;
    if !output.status.success() {
        // Jobs that Slurm no longer knows have ended.
        return match last_line(&output) {
            message if message.contains("Invalid job id") => Ok(BTreeSet::new()),
            message => Engine::Slurm.refuse(format!("the cluster does not answer: {message}")),
        };
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let indices = text.lines().filter_map(|line| line.trim().parse::<usize>().ok());
    Ok(indices.filter_map(|index| job.shards.get(index).copied()).collect())
}
