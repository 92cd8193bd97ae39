//! One run with signals, and the steps that follow it.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::inspect::{ReferenceRun, TapeExtent, ensure_nothing_left};
use super::signals::{
    Action, DeliveredSignal, Moment, PATIENCE, ProcessNames, RunOutcome, Running, ScheduledSignal, TapeProgress,
    Target, ensure_no_process_left,
};
use super::{Case, CheckResult, Rng, Tally, ensure, ensure_equal};
use crate::page::LivePage;
use crate::program::{Folder, participant};

use super::case::Role;

/// The number of scenarios of a seed.
const CASES: u64 = 48;
/// The time that the kernel and `doctor` get for what a killed orchestrator leaves behind.
const CLEANUP_TIME: Duration = Duration::from_secs(30);

/// Undisturbed runs, created on first use.
#[derive(Default)]
pub(super) struct ReferenceRuns {
    known: BTreeMap<u64, (Arc<Case>, Arc<ReferenceRun>)>,
    folders: Vec<Folder>,
}

impl ReferenceRuns {
    /// The case `number` of `seed` and its undisturbed run.
    pub(super) fn get(
        &mut self,
        seed: u64,
        number: u64,
        short: bool,
        tally: &mut Tally,
    ) -> CheckResult<(Arc<Case>, Arc<ReferenceRun>)> {
        if let Some(known) = self.known.get(&number) {
            return Ok(known.clone());
        }
        let (case, folder) = (Case::random(seed, number, short), Folder::new("reference"));
        let out = folder.path().join("run");
        let mut arguments = vec!["run".to_owned()];
        arguments.extend(case.arguments(folder.path()));
        arguments.extend(["--out".into(), out.display().to_string(), "--quiet".into()]);
        let token = format!("reference-{seed}-{number}-{}", std::process::id());
        tally.runs += 1;
        let ended = Running::start(&arguments, folder.path(), &token).finish()?;
        let healthy = || format!("the undisturbed run of case {number} failed: {ended:?}");
        ensure(ended.code == Some(case.code), healthy)?;
        ensure_no_process_left(&token, Duration::ZERO)?;
        let known = (Arc::new(case), Arc::new(ReferenceRun::read(out)?));
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
    scheduled_signals: Vec<ScheduledSignal>,
    /// The signals to the resumed run.
    again: Vec<ScheduledSignal>,
    resumes_a_complete_run: bool,
}

impl Script {
    fn random(rng: &mut Rng, case: &Case, pauses_only: bool) -> Script {
        let slots = case.slots.len();
        let saved = case.can_be_saved();
        let on_failure = !pauses_only || rng.one_in(3);
        let policies = case.slots.iter().map(|slot| match (slot.role, rng.below(3)) {
            _ if !on_failure => Policy::Stop,
            (Role::Unsaved, _) | (_, 0) => Policy::Stop,
            (Role::Damper, 1) => Policy::Substitute,
            _ => Policy::Restart,
        });
        let policies = policies.collect();
        let mut random_signals = |most: u64| -> Vec<ScheduledSignal> {
            let count = rng.between(0, most);
            (0..count)
                .map(|_| ScheduledSignal::random(rng, slots, pauses_only))
                .collect()
        };
        let (scheduled_signals, again) = (random_signals(4), random_signals(2));
        Script {
            policies,
            checkpoint_every_ms: (saved && rng.below(4) > 0).then(|| case.duration_ms / rng.between(2, 9)),
            wall_ms: rng.choose(&[0, 200, 500, 1000]),
            wait: rng.choose(&["auto", "auto", "auto", "yield", "sleep"]),
            live: rng.one_in(8),
            scheduled_signals,
            again: if rng.one_in(4) { again } else { Vec::new() },
            resumes_a_complete_run: rng.one_in(4),
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
        for (slot, policy) in case.slots.iter().zip(&self.policies) {
            let value = match policy {
                Policy::Stop => continue,
                Policy::Restart => "restart-from-checkpoint".to_owned(),
                Policy::Substitute => format!(
                    "{{ substitute = {{ exe = \"{}\" }} }}",
                    participant("memoryless").display()
                ),
            };
            more.extend(["--set".into(), format!("participants.{}.on-failure={value}", slot.name)]);
        }
        more
    }

    /// The whole scenario with its signals, for a failure report.
    fn describe(&self) -> String {
        let mut text = format!(
            "wall {} ms, checkpoints {:?} ms, wait {}, live {}, policies {:?}",
            self.wall_ms, self.checkpoint_every_ms, self.wait, self.live, self.policies
        );
        for (which, scheduled_signals) in [("run", &self.scheduled_signals), ("resume", &self.again)] {
            for scheduled in scheduled_signals {
                text += &format!(
                    "\n  {which}: {:?} {:?} {:?}",
                    scheduled.target, scheduled.action, scheduled.moment
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
    references: &mut ReferenceRuns,
    tally: &mut Tally,
) -> CheckResult<()> {
    let mut rng = Rng::new(seed, &format!("round {number}"));
    let at = rng.below(CASES);
    let (case, reference) = references.get(seed, at, false, tally)?;
    let script = Script::random(&mut rng, &case, pauses_only);
    let round = Round {
        token: format!("{seed}-{number}-{}", std::process::id()),
        folder: Folder::new("round"),
        names: case.slots.iter().map(|slot| slot.name.clone()).collect(),
        case,
        reference,
        script,
    };
    round.execute(tally).map_err(|reason| {
        let names = round.names.join(", ");
        let kept = round.folder.keep();
        format!(
            "{reason}\n  case {at} ({names}): {}\n  kept in {}",
            round.script.describe(),
            kept.display()
        )
    })
}

struct Round {
    token: String,
    folder: Folder,
    names: Vec<String>,
    case: Arc<Case>,
    reference: Arc<ReferenceRun>,
    script: Script,
}

impl Round {
    fn execute(&self, tally: &mut Tally) -> CheckResult<()> {
        let out = self.folder.path().join("run");
        let mut arguments = vec!["run".to_owned()];
        arguments.extend(self.case.arguments(self.folder.path()));
        arguments.extend(self.script.arguments(&self.case));
        let whole = self.run_with_signals(
            &arguments,
            &out,
            self.reference.up_to(0.0),
            &self.script.scheduled_signals,
            tally,
        )?;
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
            self.run_with_signals(&resume(&out), &again, before, &self.script.again, tally)?;
        }
        tally.resumes += 1;
        let last = self.folder.path().join("last");
        let whole = self.run_with_signals(&resume(&out), &last, before, &[], tally)?;
        ensure(whole, || "the resumed run is not complete".into())
    }

    /// One run with its signals, which has `before` bytes of its longest stream from the run that it resumes; returns whether it is
    /// complete.
    fn run_with_signals(
        &self,
        arguments: &[String],
        out: &Path,
        before: u64,
        scheduled_signals: &[ScheduledSignal],
        tally: &mut Tally,
    ) -> CheckResult<bool> {
        let mut arguments = arguments.to_vec();
        arguments.extend(["--out".into(), out.display().to_string()]);
        if scheduled_signals.iter().any(ScheduledSignal::is_long) {
            arguments.extend(["--patience".into(), PATIENCE.into()]);
        }
        if self.script.live {
            arguments.push("--live".into());
        }
        tally.runs += 1;
        let mut running = Running::start(&arguments, self.folder.path(), &self.token);
        let (stream, whole) = self.reference.longest();
        let progress = TapeProgress {
            stream: out.join("tape").join(stream),
            whole,
            before,
        };
        let parts = ProcessNames::Participants(self.names.clone());
        let mut delivered = Vec::new();
        for scheduled in scheduled_signals {
            let steer = |command: &str, running: &Running| {
                let page = self
                    .script
                    .live
                    .then(|| LivePage::announced_in(&running.err()))
                    .flatten();
                // The run may be over, or may not have started: then it cannot be steered.
                page.map(|page| page.try_command(command));
            };
            // The run stays paused, unless the signal waits for the tape to grow.
            if !matches!(scheduled.moment, Moment::Tape { .. }) {
                steer(r#"{"do": "pause"}"#, &running);
                steer(r#"{"do": "step", "time": "10 ms"}"#, &running);
            }
            delivered.extend(running.deliver(scheduled, &parts, out, &progress));
            steer(r#"{"do": "resume"}"#, &running);
        }
        tally.signals += running.signals;
        let ended = running.finish()?;
        let context = || format!("after {delivered:?}: {ended:?}");
        self.check_outcome(&ended, &delivered, out)
            .map_err(|reason| format!("{reason}; {}", context()))
    }

    /// Checks the invariants after a run that ended in this way.
    fn check_outcome(&self, ended: &RunOutcome, delivered: &[DeliveredSignal], out: &Path) -> CheckResult<bool> {
        let ends: Vec<i32> = delivered
            .iter()
            .filter_map(|one| Some(one.ends_the_orchestrator()?.as_raw()))
            .collect();
        // A killed orchestrator cannot clean up, and one that is interrupted twice does not.
        let sudden = ended.code.is_none() || (ended.code == Some(1) && ends.len() > 1);
        ensure_no_process_left(&self.token, if sudden { CLEANUP_TIME } else { Duration::ZERO })?;
        ensure_nothing_left(&self.folder.path().join("scratch"), sudden)?;
        ensure(!ended.err.contains("panicked at"), || "a panic".into())?;
        let part = self.reference.part(out, sudden)?;
        if let Some(signal) = ended.signal {
            let before = |one: &DeliveredSignal| {
                !one.opened && one.ends_the_orchestrator().map(|one| one.as_raw()) == Some(signal)
            };
            let killed = signal == rustix::process::Signal::KILL.as_raw() && ends.contains(&signal);
            ensure(killed || delivered.iter().any(before), || {
                format!("signal {signal} ended the orchestrator")
            })?;
            return Ok(false);
        }
        let code = ended.code.unwrap_or_default();
        if code == self.case.code {
            ensure_equal("the tape of a complete run", &part, &TapeExtent::Whole)?;
            self.reference.check_report(out, code, self.case.code, part)?;
            return Ok(true);
        }
        ensure_equal("the exit code", &code, &1)?;
        let failed_participant = self.identify_failed_participant(ended, delivered, &ends)?;
        let began = delivered.iter().any(|one| one.began);
        if began && ends.len() < 2 {
            let reported = self.reference.check_report(out, code, self.case.code, part)?;
            if let Some(failed_participant) = &failed_participant {
                ensure_equal(
                    "the participant that summary.json blames",
                    &reported.as_ref(),
                    &Some(failed_participant),
                )?;
            }
        }
        Ok(false)
    }

    /// For a run that ended with exit code 1: the participant named in the message, which must be one that received a signal.
    fn identify_failed_participant(
        &self,
        ended: &RunOutcome,
        delivered: &[DeliveredSignal],
        ends: &[i32],
    ) -> CheckResult<Option<String>> {
        if ended.err.contains("interrupted ") && !ends.is_empty() {
            return Ok(None);
        }
        let error = ended.err.lines().find_map(|line| line.strip_prefix("error: "));
        let named = error.and_then(|text| text.strip_prefix("participant `")?.split('`').next());
        let Some(failed_participant) = named else {
            return ensure(ends.len() > 1, || "the run failed and no participant is named".into()).map(|()| None);
        };
        let slot = self.names.iter().position(|name| name == failed_participant);
        let own: Vec<&DeliveredSignal> = delivered
            .iter()
            .filter(|one| one.slot == slot && one.can_fail_a_participant())
            .collect();
        ensure(!own.is_empty(), || {
            format!("`{failed_participant}` is reported as failed, but no signal can have failed it")
        })?;
        let signals = own.iter().filter_map(|one| match one.action {
            Action::Signal(signal) => Some(format!("signal {}", signal.as_raw())),
            _ => None,
        });
        let signals: Vec<String> = signals.collect();
        if signals.len() == own.len() {
            ensure(signals.iter().any(|signal| ended.err.contains(signal)), || {
                format!("the message does not give {signals:?}")
            })?;
        }
        // Every participant is restarted or replaced once, after the run has started.
        let policy = slot.map_or(Policy::Stop, |slot| self.script.policies[slot]);
        let harmful = delivered.iter().filter(|one| one.can_fail_a_participant());
        let early = harmful.clone().any(|one| !one.began);
        let all = harmful.clone().any(|one| matches!(one.target, Target::All { .. }));
        let recoverable = match policy {
            Policy::Stop => false,
            Policy::Restart => !early && !all && ends.is_empty(),
            Policy::Substitute => own.len() == 1 && harmful.count() == 1 && !early && ends.is_empty(),
        };
        ensure(!recoverable, || {
            format!("`{failed_participant}` was to be brought back ({policy:?})")
        })?;
        Ok(Some(failed_participant.to_owned()))
    }
}
