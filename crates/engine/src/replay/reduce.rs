//! The plan of a replay: of a recorded run's plan, what concerns one participant.

use std::collections::BTreeMap;
use std::path::Path;

use tape::{Reader, Source};
use toml::{Table, Value};

use super::Request;
use super::player::{self, Role};
use crate::scenario::{Program, fault_name, port_of};

/// The names of those who stand for others in a replay.
#[derive(Debug, Default)]
pub(super) struct Cast {
    subject: String,
    /// The player of what the participant said itself, where it feeds itself.
    pub(super) recorded: String,
    /// The one that listens to the participant.
    pub(super) heard: String,
}

impl Cast {
    /// Names that none of `participants` has.
    fn beside(subject: &str, participants: &Table) -> Cast {
        let free = |name: &str| unused(name, |name| participants.contains_key(name));
        Cast {
            subject: subject.to_owned(),
            recorded: free("recorded"),
            heard: free("heard"),
        }
    }

    /// The name of the player of what `producer` said: its own, for which draws are named, except where the participant feeds
    /// itself.
    fn player(&self, producer: &str) -> String {
        if producer == self.subject {
            self.recorded.clone()
        } else {
            producer.to_owned()
        }
    }
}

/// `name`, or with a number behind it if it is taken.
fn unused(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let numbered = (2_u32..).map(|number| format!("{name}-{number}"));
    let mut names = std::iter::once(name.to_owned()).chain(numbered);
    names.find(|name| !taken(name)).expect("numbers do not end")
}

/// Leaves of a plan's table the one participant, the connections into it, and players in place of those who feed it.
pub(super) fn reduce(table: &mut Table, request: &Request<'_>, reader: &Reader) -> Result<Cast, String> {
    let subject = request.participant;
    let missing = |what: &str| format!("the plan of {} has no table `{what}`", request.folder.display());
    let participants = table.get("participants").and_then(Value::as_table);
    let participants = participants.ok_or_else(|| missing("participants"))?.clone();
    let Some(Value::Table(own)) = participants.get(subject) else {
        let known: Vec<String> = participants.keys().map(|name| format!("`{name}`")).collect();
        let run = request.folder.display();
        return Err(format!(
            "{run} has no participant `{subject}`; it has {}",
            known.join(", ")
        ));
    };
    if let Some(Value::Array(inputs)) = table.get_mut("inputs") {
        let own = format!("{subject}.");
        inputs.retain(|port| port.as_str().is_some_and(|port| port.starts_with(&own)));
    }
    let mut own = own.clone();
    let cast = Cast::beside(subject, &participants);
    if let Some((exe, args)) = request.program {
        substitute(table, &mut own, exe, args)?;
    }
    let mut kept = Table::new();
    kept.insert(subject.to_owned(), Value::Table(own));
    let (mut connections, played) = feeding(table, &cast)?;
    let mut stand = |name: String, producer: &str, ports: &[String], role: Role| -> Result<(), String> {
        let original = participants.get(producer).and_then(Value::as_table);
        let entry = player_of(reader, producer, ports, role, || {
            original.ok_or_else(|| missing(&format!("participants.{producer}")))
        })?;
        kept.insert(name, Value::Table(entry));
        Ok(())
    };
    for (producer, (ports, role)) in played {
        stand(cast.player(&producer), &producer, &ports, role)?;
    }
    let said = reader.streams().iter();
    let said = said.filter(|spec| spec.participant == subject && !spec.is_seen());
    let said: Vec<String> = said.map(|spec| spec.port.clone()).collect();
    stand(cast.heard.clone(), subject, &said, Role::Listener)?;
    for port in said {
        let mut connection = Table::new();
        connection.insert("from".into(), Value::String(format!("{subject}.{port}")));
        connection.insert("to".into(), Value::String(format!("{}.{port}", cast.heard)));
        let name = unused(&format!("{}-{port}", cast.heard), |name| connections.contains_key(name));
        connections.insert(name, Value::Table(connection));
    }
    keep_faults(table, request, &cast, &kept, &connections);
    table.insert("participants".into(), Value::Table(kept));
    table.insert("connections".into(), Value::Table(connections));
    // What the run was judged by, and what ended it, is no matter of one participant.
    table.remove("assessment");
    table.remove("measures");
    table.remove("guards");
    table.remove("report");
    table.remove("scene");
    table.remove("record");
    Ok(cast)
}

/// Puts a program that was given on the command line into the participant's place.
fn substitute(table: &mut Table, own: &mut Table, exe: &Path, args: &[String]) -> Result<(), String> {
    let text = |path: &Path| {
        let text = path.to_str().map(str::to_owned);
        text.ok_or_else(|| format!("`{}` is not UTF-8: name a program that is", path.display()))
    };
    // What is given on the command line is relative to where the command is given.
    let here = std::env::current_dir().map_err(|error| format!("there is no current folder: {error}"))?;
    table.insert("folder".into(), Value::String(text(&here)?));
    let mut run = Table::new();
    let exe = text(exe)?;
    run.insert(Program::key_of(&exe).into(), Value::String(exe));
    run.insert(
        "args".into(),
        Value::Array(args.iter().cloned().map(Value::String).collect()),
    );
    own.insert("run".into(), Value::Table(run));
    Ok(())
}

/// The producers whose samples players give out: ports and role of each.
type Played = BTreeMap<String, (Vec<String>, Role)>;

/// The connections into the participant, which come from players now.
fn feeding(table: &Table, cast: &Cast) -> Result<(Table, Played), String> {
    let mut connections = Table::new();
    let mut played = Played::new();
    for (name, connection) in table.get("connections").and_then(Value::as_table).into_iter().flatten() {
        let Value::Table(mut connection) = connection.clone() else {
            continue;
        };
        let inputs: Vec<Value> = match connection.get("to") {
            Some(Value::Array(all)) => all.clone(),
            Some(one) => vec![one.clone()],
            None => Vec::new(),
        };
        let into_own = |input: &Value| {
            let port = input.as_str().and_then(|input| input.split_once('.'));
            port.is_some_and(|(participant, _)| participant == cast.subject)
        };
        let inputs: Vec<Value> = inputs.into_iter().filter(into_own).collect();
        if inputs.is_empty() {
            continue;
        }
        let from = connection.get("from").and_then(Value::as_str).unwrap_or_default();
        let field = from.strip_prefix(port_of(from)).unwrap_or_default();
        let Some((producer, port)) = port_of(from).split_once('.').map(|(a, b)| (a.to_owned(), b.to_owned())) else {
            return Err(format!("connections.{name}.from: `{from}` is not a port"));
        };
        // Only a continuous participant has a sample before the run starts.
        let first_sample = connection.get("initial").and_then(Value::as_str) == Some("first-sample");
        let (ports, role) = played.entry(producer.clone()).or_insert((Vec::new(), Role::Sampled));
        if first_sample {
            *role = Role::Continuous;
        }
        if !ports.contains(&port) {
            ports.push(port.clone());
        }
        connection.insert(
            "from".into(),
            Value::String(format!("{}.{port}{field}", cast.player(&producer))),
        );
        connection.insert("to".into(), Value::Array(inputs));
        connections.insert(name.clone(), Value::Table(connection));
    }
    Ok((connections, played))
}

/// The entry of a player of `ports` of `producer`, whose entry in the plan is `original`.
fn player_of<'a>(
    reader: &Reader,
    producer: &str,
    ports: &[String],
    role: Role,
    original: impl FnOnce() -> Result<&'a Table, String>,
) -> Result<Table, String> {
    for port in ports {
        let stream = reader.stream(&format!("{producer}.{port}"));
        stream.map_err(|error| error.to_string())?;
    }
    let original = original()?;
    let mut run = Table::new();
    run.insert("builtin".into(), Value::String(player::NAME.into()));
    let mut entry = Table::new();
    entry.insert("run".into(), Value::Table(run));
    for key in ["period", "offset"] {
        entry.extend(original.get(key).map(|value| (key.to_owned(), value.clone())));
    }
    let parameters = player::parameters(reader.dir(), producer, ports, role);
    entry.insert("parameters".into(), Value::Table(parameters));
    Ok(entry)
}

/// Leaves of a plan's faults those that disturb what the participant sees, under the names that their draws go by, and what was
/// substituted for it, unless another program is to be in its place.
fn keep_faults(table: &mut Table, request: &Request<'_>, cast: &Cast, participants: &Table, connections: &Table) {
    let subject = request.participant;
    let run = format!("participants.{subject}.run");
    let replaced = request.program.is_some()
        || request.overrides.iter().any(|one| {
            let key = one.split('=').next().unwrap_or_default().trim();
            key.strip_prefix(&run)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        });
    let Some(Value::Array(faults)) = table.get_mut("faults") else {
        return;
    };
    for (position, fault) in faults.iter_mut().enumerate() {
        if let Value::Table(fault) = fault {
            let name = fault_name(fault.get("name").and_then(Value::as_str), position);
            fault.insert("name".into(), Value::String(name));
        }
    }
    faults.retain_mut(|fault| {
        let text = |key: &str| fault.get(key).and_then(Value::as_str).map(str::to_owned);
        if let Some(connection) = text("connection") {
            return connections.contains_key(&connection);
        }
        if let Some(input) = text("input") {
            return input
                .split_once('.')
                .is_some_and(|(participant, _)| participant == subject);
        }
        if let Some(participant) = text("substitute") {
            return participant == subject && !replaced;
        }
        let output = text("output");
        let Some((producer, port)) = output.as_deref().and_then(|output| output.split_once('.')) else {
            return false;
        };
        let player = cast.player(producer);
        let played = participants
            .get(&player)
            .and_then(|player| player.get("parameters")?.get("ports")?.as_array())
            .is_some_and(|ports| ports.iter().any(|played| played.as_str() == Some(port)));
        if let Value::Table(fault) = fault {
            fault.insert("output".into(), Value::String(format!("{player}.{port}")));
        }
        played
    });
}
