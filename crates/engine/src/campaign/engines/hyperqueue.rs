//! HyperQueue, through its Python package, which contains server, worker and client and needs no command `hq`.

use std::collections::BTreeSet;
use std::io::Write;
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::engine::{Engine, last_words};
use super::job::{Job, Order};
use crate::campaign::CampaignError;
use crate::campaign::folder::identity::failed;

const SCRIPT: &str = include_str!("hyperqueue.py");
const REMEDY: &str = "it is spoken to through its Python package: activate an environment whose `python3` has it (pip install hyperqueue)";

/// Queries the package.
fn ask(asked: &Value) -> Result<Value, CampaignError> {
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
        let _ = stdin.write_all(asked.to_string().as_bytes());
    }
    let output = match child.wait_with_output() {
        Ok(output) => output,
        Err(error) => return engine.refuse(format!("`python3` does not end: {error}")),
    };
    if !output.status.success() {
        let words = last_words(&output);
        let remedy = if words.contains("ModuleNotFoundError") {
            REMEDY
        } else {
            "is its server up?"
        };
        return engine.refuse(format!("{words}; {remedy}"));
    }
    match serde_json::from_slice(&output.stdout) {
        Ok(answer) => Ok(answer),
        Err(error) => engine.refuse(format!("its answer is none ({error})")),
    }
}

pub fn version() -> Result<String, CampaignError> {
    let answer = ask(&json!({ "what": "version" }))?;
    Ok(format!("hyperqueue {}", answer.as_str().unwrap_or_default()))
}

pub fn start(order: &Order<'_>) -> Result<String, CampaignError> {
    let log = order.root.join("log");
    std::fs::create_dir_all(&log).map_err(failed(&log, "create the folder"))?;
    let answer = ask(&json!({
        "what": "submit",
        "args": order.args,
        "name": order.name,
        "folder": order.root.to_string_lossy(),
        "script": order.script.to_string_lossy(),
        "shards": order.shards,
    }))?;
    Ok(answer.as_str().unwrap_or_default().to_owned())
}

pub fn alive(job: &Job, args: &[String]) -> Result<BTreeSet<usize>, CampaignError> {
    let asked = json!({ "what": "alive", "args": args, "job": job.id, "tasks": job.shards.len() });
    let answer = ask(&asked)?;
    let tasks = answer.as_array().into_iter().flatten().filter_map(Value::as_u64);
    Ok(tasks
        .filter_map(|at| job.shards.get(usize::try_from(at).ok()?).copied())
        .collect())
}
