//! The plan of a replay: the part of a recorded run's plan that concerns one participant.

use std::collections::BTreeMap;
use std::path::Path;

use tape::{Reader, Source};

use super::Request;
use super::player::{self, Role};
use crate::scenario::{
    ConnectionSpec, Entries, FaultSpec, ParticipantSpec, RunSpec, ScenarioSpec, fault_name, port_of,
};

/// The names of the participants that replace others in a replay.
#[derive(Debug, Default)]
pub(super) struct StandIns {
    /// The participant that is replayed.
    pub(super) subject: String,
    /// The player of the participant's own outputs, if it feeds itself.
    pub(super) own_player: String,
    /// The listener to the participant's outputs.
    pub(super) listener: String,
}

impl StandIns {
    /// Names that none of `participants` has.
    fn with_unused_names(subject: &str, participants: &Entries<ParticipantSpec>) -> StandIns {
        let free = |name: &str| unused_name(name, |name| participants.contains_key(name));
        StandIns {
            subject: subject.to_owned(),
            own_player: free("recorded"),
            listener: free("heard"),
        }
    }

    /// The name of the player of the outputs of `producer`: the producer's own, which names its random streams, except where the
    /// participant feeds itself.
    pub(super) fn player(&self, producer: &str) -> String {
        if producer == self.subject {
            self.own_player.clone()
        } else {
            producer.to_owned()
        }
    }
}

/// `name`, or `name` with a number appended if it is taken.
fn unused_name(name: &str, taken: impl Fn(&str) -> bool) -> String {
    let numbered = (2_u32..).map(|number| format!("{name}-{number}"));
    let mut names = std::iter::once(name.to_owned()).chain(numbered);
    names.find(|name| !taken(name)).expect("numbers do not end")
}

/// Reduces a plan to the one participant, the connections into it, and players for the participants that feed it.
pub(super) fn reduce(spec: &mut ScenarioSpec, request: &Request<'_>, reader: &Reader) -> Result<StandIns, String> {
    let subject = request.participant;
    if let Some(run) = request.run.filter(|_| spec.participants.contains_key(subject)) {
        let set = spec.set_run(subject, run, "given with --shadow");
        set.map_err(|error| error.to_string())?;
    }
    let participants = std::mem::take(&mut spec.participants);
    let Some(subject_spec) = participants.get(subject) else {
        let known: Vec<String> = participants.keys().map(|name| format!("`{name}`")).collect();
        let run = request.folder.display();
        return Err(format!(
            "{run} has no participant `{subject}`; it has {}",
            known.join(", ")
        ));
    };
    let inputs_of = format!("{subject}.");
    spec.inputs.retain(|port| port.starts_with(&inputs_of));
    let stand_ins = StandIns::with_unused_names(subject, &participants);
    let mut subject_spec = subject_spec.clone();
    if let Some((exe, args)) = request.program {
        substitute(spec, &mut subject_spec, exe, args)?;
    }
    let mut kept = Entries::default();
    kept.insert(subject.to_owned(), subject_spec);
    let (mut connections, played) = input_connections(spec, &stand_ins)?;
    for (producer, (ports, _)) in &played {
        ports
            .iter()
            .try_for_each(|port| check_all_recorded(spec, producer, port, "reads"))?;
    }
    let mut insert_player = |name: String, producer: &str, ports: &[String], role: Role| -> Result<(), String> {
        let original = participants.get(producer).ok_or_else(|| {
            let run = request.folder.display();
            format!("the plan of {run} has no table `participants.{producer}`")
        });
        kept.insert(name, player_of(reader, producer, ports, role, original)?);
        Ok(())
    };
    for (producer, (ports, role)) in played {
        insert_player(stand_ins.player(&producer), &producer, &ports, role)?;
    }
    let output_ports = reader.streams().iter();
    let output_ports = output_ports.filter(|spec| spec.participant == subject && !spec.is_seen());
    let output_ports: Vec<String> = output_ports.map(|spec| spec.port.clone()).collect();
    output_ports
        .iter()
        .try_for_each(|port| check_all_recorded(spec, subject, port, "publishes"))?;
    insert_player(stand_ins.listener.clone(), subject, &output_ports, Role::Listener)?;
    for port in output_ports {
        let connection = ConnectionSpec::new(&format!("{subject}.{port}"), &format!("{}.{port}", stand_ins.listener));
        let name = unused_name(&format!("{}-{port}", stand_ins.listener), |name| {
            connections.contains_key(name)
        });
        connections.insert(name, connection);
    }
    spec.participants = kept;
    spec.connections = connections;
    keep_faults(spec, request, &stand_ins);
    // Assessment, measures and guards concern the whole run, not a single participant.
    spec.assessment = None;
    spec.measures.clear();
    spec.guards.clear();
    spec.report = None;
    spec.scene = None;
    spec.record.clear();
    Ok(stand_ins)
}

/// Checks that the tape has every sample of a stream that the participant `does` something with.
fn check_all_recorded(spec: &ScenarioSpec, participant: &str, port: &str, does: &str) -> Result<(), String> {
    if !spec.leaves_out(participant, port) {
        return Ok(());
    }
    Err(format!(
        "`record` leaves out samples of `{participant}.{port}`, which the participant {does}, and a replay needs all of them: record the \
         stream whole"
    ))
}

/// Replaces the participant's program by one that was given on the command line.
fn substitute(
    spec: &mut ScenarioSpec,
    subject_spec: &mut ParticipantSpec,
    exe: &Path,
    args: &[String],
) -> Result<(), String> {
    let text = |path: &Path| {
        let text = path.to_str().map(str::to_owned);
        text.ok_or_else(|| format!("`{}` is not UTF-8: name a program that is", path.display()))
    };
    // A path on the command line is relative to the current directory.
    let here = std::env::current_dir().map_err(|error| format!("there is no current folder: {error}"))?;
    spec.folder = Some(text(&here)?);
    subject_spec.run = RunSpec {
        args: args.to_vec(),
        ..RunSpec::of_file(&text(exe)?)
    };
    Ok(())
}

/// The producers whose samples players publish: ports and role of each.
type PlayedPorts = BTreeMap<String, (Vec<String>, Role)>;

/// The connections into the participant, which now come from players.
fn input_connections(
    spec: &ScenarioSpec,
    stand_ins: &StandIns,
) -> Result<(Entries<ConnectionSpec>, PlayedPorts), String> {
    let mut connections = Entries::default();
    let mut played = PlayedPorts::new();
    for (name, connection) in &spec.connections {
        let mut connection = connection.clone();
        let into_own = |input: &String| {
            let port = input.split_once('.');
            port.is_some_and(|(participant, _)| participant == stand_ins.subject)
        };
        connection.to.retain(into_own);
        if connection.to.is_empty() {
            continue;
        }
        let from = &connection.from;
        let field = from.strip_prefix(port_of(from)).unwrap_or_default();
        let Some((producer, port)) = port_of(from).split_once('.').map(|(a, b)| (a.to_owned(), b.to_owned())) else {
            return Err(format!("connections.{name}.from: `{from}` is not a port"));
        };
        // Only a continuous participant has a sample before the run starts.
        let first_sample = connection.initial.as_str() == Some("first-sample");
        let (ports, role) = played.entry(producer.clone()).or_insert((Vec::new(), Role::Sampled));
        if first_sample {
            *role = Role::Continuous;
        }
        if !ports.contains(&port) {
            ports.push(port.clone());
        }
        connection.from = format!("{}.{port}{field}", stand_ins.player(&producer));
        connections.insert(name.clone(), connection);
    }
    Ok((connections, played))
}

/// The entry of a player for `ports` of `producer`, whose entry in the plan is `original`.
fn player_of(
    reader: &Reader,
    producer: &str,
    ports: &[String],
    role: Role,
    original: Result<&ParticipantSpec, String>,
) -> Result<ParticipantSpec, String> {
    for port in ports {
        let stream = reader.stream(&format!("{producer}.{port}"));
        stream.map_err(|error| error.to_string())?;
    }
    let original = original?;
    Ok(ParticipantSpec {
        period: original.period.clone(),
        offset: original.offset.clone(),
        parameters: player::parameters(reader.dir(), producer, ports, role),
        ..ParticipantSpec::builtin(player::NAME)
    })
}

/// Keeps, of a plan's faults, those that disturb the participant's inputs, under the names of their random streams, and the
/// substitutions of the participant, unless another program is to replace it.
fn keep_faults(spec: &mut ScenarioSpec, request: &Request<'_>, stand_ins: &StandIns) {
    let run = format!("participants.{}.run", request.participant);
    let replaced = request.program.is_some()
        || request.run.is_some()
        || request.overrides.iter().any(|one| {
            let key = one.split('=').next().unwrap_or_default().trim();
            key.strip_prefix(&run)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with('.'))
        });
    for (position, fault) in spec.faults.iter_mut().enumerate() {
        fault.name = Some(fault_name(fault.name.as_deref(), position));
    }
    let (participants, connections) = (&spec.participants, &spec.connections);
    spec.faults
        .retain_mut(|fault| affects_subject(fault, stand_ins, replaced, participants, connections));
}

/// Whether `fault` disturbs the participant's inputs; a fault of an output then becomes one of its player.
fn affects_subject(
    fault: &mut FaultSpec,
    stand_ins: &StandIns,
    replaced: bool,
    participants: &Entries<ParticipantSpec>,
    connections: &Entries<ConnectionSpec>,
) -> bool {
    if let Some(connection) = &fault.connection {
        return connections.contains_key(connection);
    }
    if let Some(input) = &fault.input {
        return input
            .split_once('.')
            .is_some_and(|(participant, _)| participant == stand_ins.subject);
    }
    if let Some(participant) = &fault.substitute {
        return *participant == stand_ins.subject && !replaced;
    }
    let Some((producer, port)) = fault.output.as_deref().and_then(|output| output.split_once('.')) else {
        return false;
    };
    let player = stand_ins.player(producer);
    let played = participants
        .get(&player)
        .and_then(|player| player.parameters.get("ports")?.as_array())
        .is_some_and(|ports| ports.iter().any(|played| played.as_str() == Some(port)));
    fault.output = Some(format!("{player}.{port}"));
    played
}
