//! One run with signals, and the steps that follow it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::inspect::{Part, Reference, nothing_left};
use super::strike::{Action, Ended, Hit, Moment, PATIENCE, Parts, Progress, Running, Strike, Target, none_left};
use super::{Case, Check, Dice, Tally, demand, equal};
use crate::page::Page;
use crate::program::{Folder, participant};

use super::case::Role;

/// The number of scenarios of a seed.
const CASES: u64 = 48;
/// The time that the kernel and `doctor` get for what a killed orchestrator leaves behind.
const AFTERMATH: Duration = Duration::from_secs(30);

/// Undisturbed runs, created on first use.
#[derive(Default)]
pub(super) struct References {
    known: BTreeMap<u64, (Arc<Case>, Arc<Reference>)>,
    folders: Vec<Folder>,
}

impl References {
    /// The case `number` of `seed` and its undisturbed run.
    pub(super) fn get(
        &mut self,
        seed: u64,
        number: u64,
        short: bool,
        tally: &mut Tally,
    ) -> Check<(Arc<Case>, Arc<Reference>)> {
        if let Some(known) = self.known.get(&number) {
            return Ok(known.clone());
        }
        let (case, folder) = (Case::draw(seed, number, short), Folder::new("reference"));
        let out = folder.path().join("run");
        let mut arguments = vec!["run".to_owned()];
        arguments.extend(case.arguments(folder.path()));
        arguments.extend(["--out".into(), out.display().to_string(), "--quiet".into()]);
        let token = format!("reference-{seed}-{number}-{}", std::process::id());
        tally.runs += 1;
        let ended = Running::start(&arguments, folder.path(), &token).finish()?;
        let healthy = || format!("the undisturbed run of case {number} failed: {ended:?}");
        demand(ended.code == Some(case.code), healthy)?;
        none_left(&token, Duration::ZERO)?;
        let known = (Arc::new(case), Arc::new(Reference::read(out)?));
        self.folders.push(folder);
        self.known.insert(number, known.clone());
        Ok(known)
    }
}

/// The reaction to the failure of a participant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Policy {
    Stop,
    Restart,
    Substitute,
}

/// The actions of a round.
#[derive(Debug)]
struct Script {
    wall_ms: u64,
    policies: Vec<Policy>,
    checkpoint_every_ms: Option<u64>,
    wait: &'static str,
    live: bool,
    strikes: Vec<Strike>,
    /// The signals to the resumed run.
    again: Vec<Strike>,
    resumes_a_complete_run: bool,
}

impl Script {
    fn draw(dice: &mut Dice, case: &Case, pauses_only: bool) -> Script {
        let seats = case.seats.len();
        let saved = case.saved();
        let on_failure = !pauses_only || dice.one_in(3);
        let policies = case.seats.iter().map(|seat| match (seat.role, dice.below(3)) {
            _ if !on_failure => Policy::Stop,
            (Role::Unsaved, _) | (_, 0) => Policy::Stop,
            (Role::Damper, 1) => Policy::Substitute,
            _ => Policy::Restart,
        });
        let policies = policies.collect();
        let mut strikes = |most: u64| -> Vec<Strike> {
            let count = dice.between(0, most);
            (0..count).map(|_| Strike::draw(dice, seats, pauses_only)).collect()
        };
        let (strikes, again) = (strikes(4), strikes(2));
        Script {
            policies,
            checkpoint_every_ms: (saved && dice.below(4) > 0).then(|| case.duration_ms / dice.between(2, 9)),
            wall_ms: dice.pick(&[0, 200, 500, 1000]),
            wait: dice.pick(&["auto", "auto", "auto", "yield", "sleep"]),
            live: dice.one_in(8),
            strikes,
            again: if dice.one_in(4) { again } else { Vec::new() },
            resumes_a_complete_run: dice.one_in(4),
        }
    }

    fn arguments(&self, case: &Case) -> Vec<String> {
        let mut more = vec!["--wait".to_owned(), self.wait.to_owned()];
        if self.wall_ms > 0 {
            more.push(format!("--real-time={}", case.duration_ms as f64 / self.wall_ms as f64));
        }
        if let Some(every) = self.checkpoint_every_ms {
            more.extend(["--checkpoint-every".into(), format!("{every} ms")]);
        }
        for (seat, policy) in case.seats.iter().zip(&self.policies) {
            let value = match policy {
                Policy::Stop => continue,
                Policy::Restart => "restart-from-checkpoint".to_owned(),
                Policy::Substitute => format!(
                    "{{ substitute = {{ exe = \"{}\" }} }}",
                    participant("memoryless").display()
                ),
            };
            more.extend(["--set".into(), format!("participants.{}.on-failure={value}", seat.name)]);
        }
        more
    }

    /// The whole scenario with its signals, for a failure report.
    fn told(&self) -> String {
        let mut text = format!(
            "wall {} ms, checkpoints {:?} ms, wait {}, live {}, policies {:?}",
            self.wall_ms, self.checkpoint_every_ms, self.wait, self.live, self.policies
        );
        for (which, strikes) in [("run", &self.strikes), ("resume", &self.again)] {
            for strike in strikes {
                text += &format!(
                    "\n  {which}: {:?} {:?} {:?}",
                    strike.target, strike.action, strike.moment
                );
            }
        }
        text
    }
}

/// Round `number` of `seed`.
pub(super) fn run(
    seed: u64,
    number: u64,
    pauses_only: bool,
    references: &mut References,
    tally: &mut Tally,
) -> Check<()> {
    let mut dice = Dice::new(seed, &format!("round {number}"));
    let at = dice.below(CASES);
    let (case, reference) = references.get(seed, at, false, tally)?;
    let script = Script::draw(&mut dice, &case, pauses_only);
    let round = Round {
        token: format!("{seed}-{number}-{}", std::process::id()),
        folder: Folder::new("round"),
        names: case.seats.iter().map(|seat| seat.name.clone()).collect(),
        case,
        reference,
        script,
    };
    round.play(tally).map_err(|reason| {
        let names = round.names.join(", ");
        let kept = round.folder.keep();
        format!(
            "{reason}\n  case {at} ({names}): {}\n  kept in {}",
            round.script.told(),
            kept.display()
        )
    })
}

struct Round {
    token: String,
    folder: Folder,
    names: Vec<String>,
    case: Arc<Case>,
    reference: Arc<Reference>,
    script: Script,
}

impl Round {
    fn play(&self, tally: &mut Tally) -> Check<()> {
        let out = self.folder.path().join("run");
        let mut arguments = vec!["run".to_owned()];
        arguments.extend(self.case.arguments(self.folder.path()));
        arguments.extend(self.script.arguments(&self.case));
        let whole = self.one(&arguments, &out, self.reference.up_to(0.0), &self.script.strikes, tally)?;
        let saved = std::fs::read_dir(out.join("checkpoints")).map_or(0, |files| {
            let names = files.flatten().map(|file| file.file_name());
            names
                .filter(|name| name.as_encoded_bytes().ends_with(b".checkpoint"))
                .count()
        });
        if saved == 0 || (whole && !self.script.resumes_a_complete_run) {
            return Ok(());
        }
        let newest_ms = saved as u64 * self.script.checkpoint_every_ms.unwrap_or_default();
        let before = self.reference.up_to(newest_ms as f64 / 1000.0);
        // A checkpoint remains valid whatever happened to its run, and to other runs that continued from it.
        let resume = |from: &Path| vec!["resume".to_owned(), from.display().to_string()];
        if !self.script.again.is_empty() {
            let again = self.folder.path().join("again");
            tally.resumes += 1;
            self.one(&resume(&out), &again, before, &self.script.again, tally)?;
        }
        tally.resumes += 1;
        let last = self.folder.path().join("last");
        let whole = self.one(&resume(&out), &last, before, &[], tally)?;
        demand(whole, || "the resumed run is not complete".into())
    }

    /// One run with its signals, which has `before` bytes of its longest stream from the run that it resumes; returns whether it is
    /// complete.
    fn one(&self, arguments: &[String], out: &Path, before: u64, strikes: &[Strike], tally: &mut Tally) -> Check<bool> {
        let mut arguments = arguments.to_vec();
        arguments.extend(["--out".into(), out.display().to_string()]);
        if strikes.iter().any(Strike::is_long) {
            arguments.extend(["--patience".into(), PATIENCE.into()]);
        }
        if self.script.live {
            arguments.push("--live".into());
        }
        tally.runs += 1;
        let mut running = Running::start(&arguments, self.folder.path(), &self.token);
        let (stream, whole) = self.reference.longest();
        let progress = Progress {
            stream: out.join("tape").join(stream),
            whole,
            before,
        };
        let parts = Parts::Seats(self.names.clone());
        let mut hits = Vec::new();
        for strike in strikes {
            let steer = |command: &str, running: &Running| {
                let page = self.script.live.then(|| Page::of(&running.err())).flatten();
                // The run may be over, or may not have started: then it cannot be steered.
                page.map(|page| page.try_command(command));
            };
            // The run stays paused, unless the signal waits for the tape to grow.
            if !matches!(strike.moment, Moment::Tape { .. }) {
                steer(r#"{"do": "pause"}"#, &running);
                steer(r#"{"do": "step", "time": "10 ms"}"#, &running);
            }
            hits.extend(running.deliver(strike, &parts, out, &progress));
            steer(r#"{"do": "resume"}"#, &running);
        }
        tally.signals += running.signals;
        let ended = running.finish()?;
        let told = || format!("after {hits:?}: {ended:?}");
        self.judge(&ended, &hits, out)
            .map_err(|reason| format!("{reason}; {}", told()))
    }

    /// Checks the invariants after a run that ended in this way.
    fn judge(&self, ended: &Ended, hits: &[Hit], out: &Path) -> Check<bool> {
        let ends: Vec<i32> = hits
            .iter()
            .filter_map(|hit| Some(hit.ends_the_orchestrator()?.as_raw()))
            .collect();
        // A killed orchestrator cannot clean up, and one that is interrupted twice does not.
        let sudden = ended.code.is_none() || (ended.code == Some(1) && ends.len() > 1);
        none_left(&self.token, if sudden { AFTERMATH } else { Duration::ZERO })?;
        nothing_left(&self.folder.path().join("scratch"), sudden)?;
        demand(!ended.err.contains("panicked at"), || "a panic".into())?;
        let part = self.reference.part(out, sudden)?;
        if let Some(signal) = ended.signal {
            let before = |hit: &Hit| !hit.opened && hit.ends_the_orchestrator().map(|one| one.as_raw()) == Some(signal);
            let killed = signal == rustix::process::Signal::KILL.as_raw() && ends.contains(&signal);
            demand(killed || hits.iter().any(before), || {
                format!("signal {signal} ended the orchestrator")
            })?;
            return Ok(false);
        }
        let code = ended.code.unwrap_or_default();
        if code == self.case.code {
            equal("the tape of a complete run", &part, &Part::Whole)?;
            self.reference.account(out, code, self.case.code, part)?;
            return Ok(true);
        }
        equal("the exit code", &code, &1)?;
        let culprit = self.blamed(ended, hits, &ends)?;
        let began = hits.iter().any(|hit| hit.began);
        if began && ends.len() < 2 {
            let told = self.reference.account(out, code, self.case.code, part)?;
            if let Some(culprit) = &culprit {
                equal(
                    "the participant that summary.json blames",
                    &told.as_ref(),
                    &Some(culprit),
                )?;
            }
        }
        Ok(false)
    }

    /// For a run that ended with exit code 1: the participant named in the message, which must be one that received a signal.
    fn blamed(&self, ended: &Ended, hits: &[Hit], ends: &[i32]) -> Check<Option<String>> {
        if ended.err.contains("interrupted ") && !ends.is_empty() {
            return Ok(None);
        }
        let error = ended.err.lines().find_map(|line| line.strip_prefix("error: "));
        let named = error.and_then(|text| text.strip_prefix("participant `")?.split('`').next());
        let Some(culprit) = named else {
            return demand(ends.len() > 1, || "the run failed and no participant is named".into()).map(|()| None);
        };
        let seat = self.names.iter().position(|name| name == culprit);
        let own: Vec<&Hit> = hits
            .iter()
            .filter(|hit| hit.seat == seat && hit.harms_a_participant())
            .collect();
        demand(!own.is_empty(), || {
            format!("`{culprit}` is blamed, which nothing harmed")
        })?;
        let signals = own.iter().filter_map(|hit| match hit.action {
            Action::Signal(signal) => Some(format!("signal {}", signal.as_raw())),
            _ => None,
        });
        let signals: Vec<String> = signals.collect();
        if signals.len() == own.len() {
            demand(signals.iter().any(|signal| ended.err.contains(signal)), || {
                format!("the message does not give {signals:?}")
            })?;
        }
        // Every participant is restarted or replaced once, after the run has started.
        let policy = seat.map_or(Policy::Stop, |seat| self.script.policies[seat]);
        let harmful = hits.iter().filter(|hit| hit.harms_a_participant());
        let early = harmful.clone().any(|hit| !hit.began);
        let all = harmful.clone().any(|hit| matches!(hit.target, Target::All { .. }));
        let survivable = match policy {
            Policy::Stop => false,
            Policy::Restart => !early && !all && ends.is_empty(),
            Policy::Substitute => own.len() == 1 && harmful.count() == 1 && !early && ends.is_empty(),
        };
        demand(!survivable, || {
            format!("`{culprit}` was to be brought back ({policy:?})")
        })?;
        Ok(Some(culprit.to_owned()))
    }
}
