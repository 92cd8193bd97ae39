//! A whole scenario, stepped by the importer: the engine runs it in one loop.

use engine::Progress;
use engine::campaign;
use engine::run::{Options, Record, Run, check_here};
use engine::scenario::Scenario;
use lockstep::participant::{Kind, Payload};
use lockstep::plan::Plan;
use lockstep::time::{Rational, Ticks, Timebase};
use lockstep::wire;
use serde::{Deserialize, Serialize};

use crate::body::{self, Body, State};
use crate::lines::Lines;
use crate::parameter::Parameter;
use crate::refusal::Refusal;
use crate::variable::{Port, Ports};

/// A whole scenario.
///
/// An output at T is its newest sample stamped at or before T: for a continuous participant the one at T, if it has one there; for a
/// sampled one the one before T, because its activation at T belongs to the step that begins there.
pub struct ScenarioBody {
    scenario: Scenario,
    plan: Plan,
    ports: Ports,
    keys: Vec<String>,
    can_save_state: bool,
    inputs: Vec<Payload>,
    /// The inputs that the run was given, replayed when another instance restores a state.
    history: Vec<InputChange>,
    /// Inputs that differ from those the run was given.
    changed: Vec<bool>,
    outputs: Vec<Payload>,
    /// The sample times of continuous outputs: offset and period of each participant, ticks.
    grids: Vec<Option<(Ticks, Ticks)>>,
    figures: Option<campaign::Figures>,
    running: Option<Run>,
    lines: Lines,
    start: f64,
    now: Ticks,
}

/// The value of an input, set at an instant.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct InputChange {
    at: Ticks,
    input: u64,
    payload: Vec<u8>,
}

#[derive(Serialize, Deserialize)]
struct Saved {
    inputs: Vec<Vec<u8>>,
    outputs: Vec<Vec<u8>>,
    running: Option<SavedRun>,
}

#[derive(Serialize, Deserialize)]
struct SavedRun {
    start: f64,
    now: Ticks,
    history: Vec<InputChange>,
}

impl ScenarioBody {
    /// Prepares the `scenario` with these inputs and outputs.
    ///
    /// # Errors
    /// The reason why it cannot run in one loop, or a port that does not exist.
    pub fn new(
        scenario: Scenario,
        inputs: &[String],
        outputs: &[String],
        can_save_state: bool,
    ) -> Result<ScenarioBody, String> {
        let known = check_here(&scenario).map_err(|error| error.to_string())?;
        let outside = scenario
            .participants
            .iter()
            .zip(&known.interfaces)
            .find(|(_, interface)| interface.is_none());
        if let Some((entry, _)) = outside {
            return Err(format!(
                "`{}` is a program of its own, which is no part of an FMU: make a plug-in of it, or put it into the program",
                entry.setup.name
            ));
        }
        let plan = known.plan;
        let figures = campaign::figures_of(&scenario, &plan).ordered();
        let mut ports = Ports {
            discrete: true,
            figures: figures.iter().map(|one| (one.name.clone(), one.unit.clone())).collect(),
            ..Ports::default()
        };
        for name in inputs {
            ports.inputs.push(input(&plan, name)?);
        }
        let mut grids = Vec::new();
        for name in outputs {
            let (port, grid) = output(&plan, name)?;
            ports.outputs.push(port);
            grids.push(grid);
        }
        let zeros = |all: &[Port]| {
            all.iter()
                .map(|one| Payload::zeroed(one.descriptor.size as usize))
                .collect::<Vec<_>>()
        };
        Ok(ScenarioBody {
            inputs: zeros(&ports.inputs),
            outputs: zeros(&ports.outputs),
            changed: vec![false; ports.inputs.len()],
            history: Vec::new(),
            keys: figures.into_iter().map(|one| one.key).collect(),
            figures: None,
            running: None,
            lines: Lines::default(),
            start: 0.0,
            now: 0,
            scenario,
            plan,
            ports,
            can_save_state,
            grids,
        })
    }

    /// Steps are whole multiples of this.
    pub fn period(&self) -> Rational {
        self.plan.timebase.tick()
    }

    /// The duration.
    pub fn duration(&self) -> Rational {
        self.scenario.duration
    }

    fn timebase(&self) -> Timebase {
        self.plan.timebase
    }

    fn start_run(&self) -> Result<Run, String> {
        let record = if self.can_save_state {
            Record::Memory
        } else {
            Record::Nothing
        };
        let options = Options {
            in_process: true,
            record,
            no_placement: true,
            progress: Progress::new(self.lines.clone()),
            ..Options::default()
        };
        Run::start(&self.scenario, &options).map_err(|failure| failure.to_string())
    }

    fn run(&mut self) -> Result<&mut Run, String> {
        self.running.as_mut().ok_or_else(|| "it is not initialised".to_owned())
    }

    /// Ends the run, if there is one: participants may log something at their end.
    fn end(&mut self) {
        if let Some(run) = self.running.take() {
            // Nothing is written, and the outcome is not used.
            let _ = run.end();
        }
    }

    /// Advances the run to `to`, ticks.
    fn run_to(&mut self, to: Ticks) -> Result<(), String> {
        let time = self.timebase().time(to).ok_or("the time is too fine")?;
        let end = self.duration();
        let run = self.run()?;
        let done = if time >= end { run.run_to(end) } else { run.run_to(time) };
        done.map_err(|failure| failure.to_string())
    }

    /// Reads outputs at `to` while advancing the run to it.
    fn advance_to(&mut self, to: Ticks) -> Result<(), String> {
        // A continuous output may have a sample stamped later than `to`: its newest sample at or before `to` is read on the way.
        let due: Vec<Option<Ticks>> = self.grids.iter().map(|grid| due(*grid, to)).collect();
        let mut stops: Vec<Ticks> = due
            .iter()
            .flatten()
            .copied()
            .filter(|at| (self.now..to).contains(at))
            .collect();
        stops.sort_unstable();
        stops.dedup();
        stops.push(to);
        for stop in stops {
            self.run_to(stop)?;
            self.read(&due, stop);
        }
        self.now = to;
        self.figures = None;
        Ok(())
    }

    /// Reads the outputs due at `at`, where the run is paused. Before its first sample an output is zero.
    fn read(&mut self, due: &[Option<Ticks>], at: Ticks) {
        let Some(run) = &self.running else {
            return;
        };
        for (number, due) in due.iter().enumerate() {
            if *due == Some(at)
                && let Ok(sample) = run.newest(&self.ports.outputs[number].name)
            {
                self.outputs[number].bytes_mut().copy_from_slice(sample.bytes());
            }
        }
    }

    /// Passes the changed inputs to the run.
    fn apply_inputs(&mut self) -> Result<(), String> {
        for number in 0..self.inputs.len() {
            if !std::mem::take(&mut self.changed[number]) {
                continue;
            }
            let (name, payload) = (
                self.ports.inputs[number].name.clone(),
                self.inputs[number].bytes().to_vec(),
            );
            self.run()?
                .set_bytes(&name, &payload)
                .map_err(|failure| failure.to_string())?;
            if self.can_save_state {
                let (at, input) = (self.now, number as u64);
                self.history.push(InputChange { at, input, payload });
            }
        }
        Ok(())
    }

    /// Restarts, and replays `history` up to `now`.
    fn replay(&mut self, run: SavedRun) -> Result<(), String> {
        self.begin(&[], Rational::ZERO)?;
        self.start = run.start;
        for change in run.history {
            let number = usize::try_from(change.input)
                .ok()
                .filter(|number| *number < self.inputs.len());
            let number = number.filter(|number| self.inputs[*number].bytes().len() == change.payload.len());
            let number = number.ok_or("the state has inputs of another FMU")?;
            if change.at > self.now {
                self.advance_to(change.at)?;
            }
            self.inputs[number].bytes_mut().copy_from_slice(&change.payload);
            self.changed[number] = true;
            self.apply_inputs()?;
        }
        if run.now > self.now {
            self.advance_to(run.now)?;
        }
        // These lines were logged when this was first executed.
        self.lines.take();
        Ok(())
    }
}

/// The instant at which an output is read for its value at `to`: for a continuous one that of its newest sample by then, if there is one.
fn due(grid: Option<(Ticks, Ticks)>, to: Ticks) -> Option<Ticks> {
    match grid {
        None => Some(to),
        Some((offset, period)) => (to >= offset).then(|| to - (to - offset) % period),
    }
}

/// The unconnected input `name`.
fn input(plan: &Plan, name: &str) -> Result<Port, String> {
    let (participant, port) = name.split_once('.').unwrap_or((name, ""));
    let found = plan.participant(participant).and_then(|number| {
        let own = &plan.participants[number];
        let at = own.interface.inputs.iter().position(|one| one.name == port)?;
        Some((own, at))
    });
    let Some((own, at)) = found else {
        let all = plan.participants.iter().flat_map(|own| {
            let free = own
                .interface
                .inputs
                .iter()
                .enumerate()
                .filter(|(at, _)| own.inputs[*at].is_empty());
            free.map(|(_, one)| format!("`{}.{}`", own.name, one.name))
        });
        return Err(format!(
            "there is no input `{name}`; nothing feeds {}",
            joined_names(all)
        ));
    };
    if let Some(&link) = own.inputs[at].first() {
        let link = &plan.links[link];
        let (from, link) = (plan.output_name(link.from), &link.name);
        return Err(format!(
            "the input `{name}` is fed by `{from}`, by the connection `{link}`: leave that out of the scenario"
        ));
    }
    Ok(Port {
        name: name.to_owned(),
        descriptor: own.interface.inputs[at].descriptor.clone(),
    })
}

fn joined_names(all: impl Iterator<Item = String>) -> String {
    let all: Vec<String> = all.collect();
    if all.is_empty() {
        "nothing".to_owned()
    } else {
        all.join(", ")
    }
}

/// The output `name`, with offset and period if its participant is continuous.
fn output(plan: &Plan, name: &str) -> Result<(Port, Option<(Ticks, Ticks)>), String> {
    for own in &plan.participants {
        for port in &own.interface.outputs {
            if format!("{}.{}", own.name, port.name) == name {
                let found = Port {
                    name: name.to_owned(),
                    descriptor: port.descriptor.clone(),
                };
                let continuous = own.interface.kind == Kind::Continuous;
                return Ok((
                    found,
                    continuous.then_some((own.sample_time.offset, own.sample_time.period)),
                ));
            }
        }
    }
    Err(format!(
        "there is no output `{name}`; there is {}",
        joined_names(outputs(plan).into_iter().map(|one| format!("`{one}`")))
    ))
}

/// All outputs of a plan.
pub fn outputs(plan: &Plan) -> Vec<String> {
    let all = plan.participants.iter();
    all.flat_map(|own| {
        own.interface
            .outputs
            .iter()
            .map(|port| format!("{}.{}", own.name, port.name))
    })
    .collect()
}

impl Body for ScenarioBody {
    fn ports(&self) -> &Ports {
        &self.ports
    }

    fn begin(&mut self, _: &[Parameter], start: Rational) -> Result<(), String> {
        self.end();
        self.running = Some(self.start_run()?);
        (self.start, self.now) = (start.seconds(), 0);
        self.history.clear();
        // Values set before are set from the start on.
        self.changed = self
            .inputs
            .iter()
            .map(|one| one.bytes().iter().any(|byte| *byte != 0))
            .collect();
        self.outputs.iter_mut().for_each(|one| one.bytes_mut().fill(0));
        let due: Vec<Option<Ticks>> = self.grids.iter().map(|grid| due(*grid, 0)).collect();
        self.read(&due, 0);
        self.figures = None;
        Ok(())
    }

    fn reset(&mut self) {
        self.end();
        for all in [&mut self.inputs, &mut self.outputs] {
            all.iter_mut().for_each(|one| one.bytes_mut().fill(0));
        }
        (self.start, self.now) = (0.0, 0);
    }

    fn time(&self) -> f64 {
        self.start + self.timebase().seconds(self.now)
    }

    fn input(&self, port: usize) -> &[u8] {
        self.inputs[port].bytes()
    }

    fn set(&mut self, port: usize, at: usize, bytes: &[u8]) {
        let place = &mut self.inputs[port].bytes_mut()[at..at + bytes.len()];
        if place != bytes {
            place.copy_from_slice(bytes);
            self.changed[port] = true;
        }
    }

    fn output(&mut self, port: usize) -> Result<&[u8], String> {
        Ok(self.outputs[port].bytes())
    }

    fn figure(&mut self, number: usize) -> Result<f64, String> {
        if self.figures.is_none() {
            let found = self.running.as_ref().and_then(Run::figures);
            self.figures = found.map(|found| campaign::Figures::of(&found));
        }
        let value = self
            .figures
            .as_ref()
            .and_then(|figures| figures.value(&self.keys[number]));
        Ok(value.unwrap_or(f64::NAN))
    }

    fn advance(&mut self, from: f64, span: f64) -> Result<(), Refusal> {
        if self.running.is_none() {
            return Err(Refusal::error("it is not initialised"));
        }
        let tick = self.timebase().tick().seconds();
        let count = body::whole_steps(self.time(), tick, from, span)?;
        let to = i64::try_from(count).ok().and_then(|count| self.now.checked_add(count));
        let end = self.plan.end;
        let Some(to) = to.filter(|to| *to <= end) else {
            return Err(Refusal::discard(format!(
                "the scenario ends at t = {} s: export it with a longer duration",
                self.start + self.timebase().seconds(end)
            )));
        };
        self.apply_inputs()?;
        Ok(self.advance_to(to)?)
    }

    fn is_over(&self) -> bool {
        self.now >= self.plan.end
    }

    fn take_log_lines(&mut self) -> Vec<String> {
        self.lines.take()
    }

    fn save(&mut self) -> Result<State, String> {
        let running = self.running.as_ref().map(|_| SavedRun {
            start: self.start,
            now: self.now,
            history: self.history.clone(),
        });
        let bytes_of = |all: &[Payload]| all.iter().map(|one| one.bytes().to_vec()).collect();
        let saved = Saved {
            inputs: bytes_of(&self.inputs),
            outputs: bytes_of(&self.outputs),
            running,
        };
        let bytes = wire::encode("the state of a scenario", &saved).map_err(|error| error.to_string())?;
        // At its end a run has no state any more, and is replayed.
        let checkpoint = self.running.as_mut().and_then(|run| run.save().ok());
        Ok(State { bytes, checkpoint })
    }

    fn restore(&mut self, _: &[Parameter], state: &State) -> Result<(), String> {
        let saved: Saved = wire::decode("the state of a scenario", &state.bytes).map_err(|error| error.to_string())?;
        let fits =
            |saved: &[Vec<u8>], own: &[Payload]| saved.iter().map(Vec::len).eq(own.iter().map(|one| one.bytes().len()));
        if !fits(&saved.inputs, &self.inputs) || !fits(&saved.outputs, &self.outputs) {
            return Err("the state has ports of other sizes: it is another FMU's".into());
        }
        match saved.running {
            None => self.running = None,
            Some(run) => {
                let restored = match (&state.checkpoint, &mut self.running) {
                    (Some(checkpoint), Some(own)) => own.restore(checkpoint).is_ok(),
                    _ => false,
                };
                if restored {
                    (self.start, self.now, self.history, self.figures) = (run.start, run.now, run.history, None);
                } else {
                    self.replay(run)?;
                }
            }
        }
        let saved = saved.inputs.iter().chain(&saved.outputs);
        for (own, bytes) in self.inputs.iter_mut().chain(&mut self.outputs).zip(saved) {
            own.bytes_mut().copy_from_slice(bytes);
        }
        // The inputs that were set and not yet passed to the run.
        let last_change = |number: usize| self.history.iter().rev().find(|change| change.input == number as u64);
        let changed = (0..self.inputs.len()).map(|number| match last_change(number) {
            Some(change) => change.payload != self.inputs[number].bytes(),
            None => self.inputs[number].bytes().iter().any(|byte| *byte != 0),
        });
        self.changed = changed.collect();
        Ok(())
    }
}
