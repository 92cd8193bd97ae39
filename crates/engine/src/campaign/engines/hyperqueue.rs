//! HyperQueue, through its Python package, which contains server, worker and client and needs no command `hq`.

use std::collections::BTreeSet;
use std::io::Write;
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::engine::{Engine, last_line};
use super::job::{Job, JobRequest};
use crate::campaign::CampaignError;
use crate::campaign::folder::identity::io_error;

const SCRIPT: &str = include_str!("hyperqueue.py");
const REMEDY: &str = "it is spoken to through its Python package: activate an environment whose `python3` has it (pip install hyperqueue)";

/// The beginning of a message about the user's options, as the script writes it.
const ARGUMENTS: &str = "--engine-args: ";
const OPTIONS: &str = "there is --server-dir, --cpus, --priority and --crash-limit";

/// The error `message` of the package, with what can be done about it.
fn with_remedy(message: &str) -> String {
    if message.contains("ModuleNotFoundError") {
        format!("{message}; {REMEDY}")
    } else if message.starts_with(ARGUMENTS) {
        // The options are wrong, whether its server is up or not.
        format!("{message}; {OPTIONS}")
    } else {
        format!("{message}; is its server up?")
    }
}

/// Queries the package.
fn query(request: &Value) -> Result<Value, CampaignError> {
    let engine = Engine::Hyperqueue;
    let mut command = Command::new("python3");
    command
        .args(["-c", SCRIPT])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = match command.spawn() {
        Ok(child) => child,
        Err(error) => return engine.refuse(format!("`python3` cannot be started ({error}): {REMEDY}")),
    };
    if let Some(mut stdin) = child.stdin.take() {
        // The error of a process that has ended is reported below.
        let _ = stdin.write_all(request.to_string().as_bytes());
    }
    let output = match child.wait_with_output() {
        Ok(output) => output,
        Err(error) => return engine.refuse(format!("`python3` does not end: {error}")),
    };
    if !output.status.success() {
        return engine.refuse(with_remedy(&last_line(&output)));
    }
    match serde_json::from_slice(&output.stdout) {
        Ok(reply) => Ok(reply),
        Err(error) => engine.refuse(format!("its answer is none ({error})")),
    }
}

pub fn version() -> Result<String, CampaignError> {
    let reply = query(&json!({ "what": "version" }))?;
    Ok(format!("hyperqueue {}", reply.as_str().unwrap_or_default()))
}

pub fn start(request: &JobRequest<'_>) -> Result<String, CampaignError> {
    let log = request.root.join("log");
    std::fs::create_dir_all(&log).map_err(io_error(&log, "create the folder"))?;
    let reply = query(&json!({
        "what": "submit",
        "args": request.args,
        "name": request.name,
        "folder": request.root.to_string_lossy(),
        "script": request.script.to_string_lossy(),
        "shards": request.shards,
    }))?;
    Ok(reply.as_str().unwrap_or_default().to_owned())
}

pub fn active_shards(job: &Job, args: &[String]) -> Result<BTreeSet<usize>, CampaignError> {
    let request = json!({ "what": "alive", "args": args, "job": job.id, "tasks": job.shards.len() });
    let reply = query(&request)?;
    let tasks = reply.as_array().into_iter().flatten().filter_map(Value::as_u64);
    Ok(tasks
        .filter_map(|at| job.shards.get(usize::try_from(at).ok()?).copied())
        .collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A mistake in the options is no reason to look at the server.
    #[test]
    fn remedy_follows_from_the_message() {
        let wrong = with_remedy("--engine-args: error: unrecognized arguments: --foo=9");
        assert!(wrong.contains("--cpus") && !wrong.contains("server up"), "{wrong}");
        assert!(with_remedy("RuntimeError: no connection").contains("is its server up?"));
        assert!(with_remedy("ModuleNotFoundError: No module").contains("pip install"));
    }
}
