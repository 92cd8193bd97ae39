//! Failure recovery: which participants are restarted or replaced, and when the run ends instead.

use std::time::Duration;

use lockstep::plan::Cut;
use lockstep::time::Ticks;
use tape::{Event, EventKind};

use super::attend::keep_for_restarts;
use super::awake::Patience;
use super::course::Course;
use super::crew::Taken;
use super::executor::Seat;
use super::explain;
use super::fallen::{Fallen, RESTARTS_MAX, Restarts};
use super::outcome::{Ending, RunFailure};
use super::prepare;
use super::processes::{BATCHES, Processes};
use crate::scenario::OnFailure;

/// Why a run ends when a guard violation is found only at its end: a substitute that does nothing would only hide the violation.
const NOTHING_LEFT: &str = "it had taken its last step when its outputs were looked at, so a substitute has nothing to do; where the run \
                            rests (`--checkpoint-every`) everything before is looked at first";

impl Processes {
    /// Handles the failure in `ending` as the scenario says: returns when the run can continue, or returns the ending as an error.
    /// A participant that fails while the run is taken up counts as one more failure.
    pub(super) fn survive_failure(&mut self, course: &mut Course, ending: Ending) -> Result<(), Ending> {
        let Ending::Failed { participant, reason } = &ending else {
            return Err(ending);
        };
        let Some(number) = course.plan.participant(participant) else {
            return Err(ending);
        };
        let reason = reason.clone();
        let mut fallen = vec![Fallen { number, reason }];
        let others = std::mem::take(&mut self.failures.fallen);
        fallen.extend(others.into_iter().filter(|one| one.number != number));
        let first = fallen[0].clone();
        let mut judged = 0;
        loop {
            for one in &fallen[judged..] {
                self.judge(course, one, &first)?;
            }
            judged = fallen.len();
            let done = self.recall(course, &mut fallen).and_then(|()| {
                if fallen.len() > judged {
                    // Another participant failed meanwhile, and must be judged before anything is done.
                    return Ok(None);
                }
                self.recover(course, &fallen).map(Some)
            });
            match done {
                Ok(Some(missing)) if missing.is_empty() => return Ok(()),
                Ok(Some(missing)) => (fallen, judged) = (missing, 0),
                Ok(None) => {}
                Err(RunFailure::Interrupted) => return Err(course.over(RunFailure::Interrupted)),
                // The first failure matters most.
                Err(second) => {
                    return Err(Ending::Failed {
                        participant: course.plan.participants[first.number].name.clone(),
                        reason: format!("{}\nand the run could not be taken up: {second}", first.reason),
                    });
                }
            }
        }
    }

    /// Fails if the run must end because of `one`. If it is not `first`, it failed after that.
    fn judge(&mut self, course: &mut Course, one: &Fallen, first: &Fallen) -> Result<(), Ending> {
        let participant = course.plan.participants[one.number].name.clone();
        let mut over = None;
        if course.entries[one.number].on_failure == OnFailure::Stop || self.crew.is_empty() {
            over = Some(String::new());
        } else {
            let furthest = self.crew[one.number].status().next;
            let restarts = &mut self.failures.restarts[one.number];
            if furthest > restarts.furthest {
                *restarts = Restarts { furthest, count: 0 };
            }
            restarts.count += 1;
            if restarts.count > RESTARTS_MAX {
                over = Some(format!(
                    "\n(taken up again {RESTARTS_MAX} times without getting any further)"
                ));
            }
        }
        let Some(mut more) = over else {
            course
                .options
                .progress
                .say(&format!("participant `{participant}`: {}", one.reason));
            return Ok(());
        };
        if one.number != first.number {
            let name = &course.plan.participants[first.number].name;
            more += &format!(
                "\n(when the run was to go on after participant `{name}`: {})",
                first.first_line()
            );
        }
        let reason = one.reason.clone() + &more;
        Err(Ending::Failed { participant, reason })
    }

    /// Ends the processes of `fallen`, and brings all other participants to rest. A participant that fails before it rests is added
    /// to `fallen`.
    fn recall(&mut self, course: &mut Course, fallen: &mut Vec<Fallen>) -> Result<(), RunFailure> {
        for one in fallen.iter() {
            let member = &mut self.crew[one.number];
            member.process.bring_down(Duration::ZERO);
            member.failed = None;
            // The samples that it had handed over count, up to the first faulty one.
            while let Ok(Taken::Old | Taken::News) = member.take(one.number, &mut course.recorder()) {}
        }
        self.place.clock.recall();
        let mut patience = Patience::new(course.options.patience());
        loop {
            let mut left = None;
            for number in 0..self.crew.len() {
                if fallen.iter().any(|one| one.number == number) {
                    continue;
                }
                match self.comes_to_rest(course, number)? {
                    Ok(true) => {}
                    Ok(false) => left = Some(number),
                    Err(reason) => {
                        self.crew[number].process.bring_down(Duration::ZERO);
                        fallen.push(Fallen { number, reason });
                    }
                }
            }
            let Some(number) = left else { return Ok(()) };
            if self.monitor.asked() {
                return Err(RunFailure::Interrupted);
            }
            if patience.is_over() {
                let process = &mut self.crew[number].process;
                let limit = patience.limit_s();
                let reason = format!("process {} did not come to rest within {limit} s", process.pid());
                process.bring_down(Duration::ZERO);
                fallen.push(Fallen { number, reason });
            }
            std::thread::sleep(Duration::from_micros(300));
        }
    }

    /// Whether participant number `number` has come to rest; if it failed too, the reason.
    fn comes_to_rest(&mut self, course: &mut Course, number: usize) -> Result<Result<bool, String>, RunFailure> {
        let member = &mut self.crew[number];
        member.ring();
        let ended = member.process.ended();
        // Bounded, because a participant may send notes without end.
        for _ in 0..BATCHES {
            let taken = member.take(number, &mut course.recorder());
            match taken {
                Ok(Taken::Old | Taken::News) => {}
                Ok(Taken::Nothing) => break,
                Err(broken) => {
                    let error = course.recorder().take_error();
                    return match error {
                        Some(error) => Err(error.into()),
                        None => Ok(Err(broken.0)),
                    };
                }
            }
        }
        if let Some(failed) = member.failure() {
            return Ok(Err(failed));
        }
        match ended {
            // A participant that ended after it came to rest is found missing during the move.
            Some(status) if member.recalled.is_none() => {
                let last = member.status();
                Ok(Err(explain::death(&course.plan, number, &member.process, last, status)))
            }
            _ => Ok(Ok(member.recalled.is_some())),
        }
    }

    /// Continues the run as the scenario says; all participants are at rest except `fallen`, whose processes have ended. Returns
    /// those that fail meanwhile.
    fn recover(&mut self, course: &mut Course, fallen: &[Fallen]) -> Result<Vec<Fallen>, RunFailure> {
        // A different program would not reproduce the samples on the tape: a participant that fails while the run goes back is
        // restarted too.
        let mut fallen_numbers = fallen.iter().map(|one| one.number);
        if fallen_numbers.any(|number| {
            course.entries[number].on_failure == OnFailure::Restart || course.recorder().is_ahead_of(number)
        }) {
            self.go_back(course, fallen)
        } else {
            self.replace(course, fallen)
        }
    }

    /// Takes all participants back to the last checkpoint, and `fallen` in new processes, whatever their policy: no state of theirs
    /// is lost that way.
    fn go_back(&mut self, course: &mut Course, fallen: &[Fallen]) -> Result<Vec<Fallen>, RunFailure> {
        let Some(checkpoint) = course.last_checkpoint.clone() else {
            return Err(RunFailure::Other("there is no checkpoint to go back to".into()));
        };
        let seats = prepare::seats_at(course, &checkpoint, |number| {
            fallen.iter().any(|one| one.number == number)
        });
        {
            let mut recorder = course.recorder();
            recorder.expect_again()?;
            if let Some(rest) = &checkpoint.rest {
                recorder.remember(&rest.samples);
            }
        }
        let missing = self.move_everybody(course, &checkpoint.cut, seats)?;
        course.substituted = usize::try_from(checkpoint.substitutions).unwrap_or(usize::MAX);
        course.guide.rewind(&course.scenario, &course.plan, course.substituted);
        for one in fallen {
            let text = format!(
                "restarted from the checkpoint at t = {}: {}",
                checkpoint.time,
                one.first_line()
            );
            Self::note(course, EventKind::Restart, course.newest().max(0), one.number, text)?;
        }
        Ok(missing)
    }

    /// Replaces `fallen` by other programs, at the activations that the failed ones had reached.
    fn replace(&mut self, course: &mut Course, fallen: &[Fallen]) -> Result<Vec<Fallen>, RunFailure> {
        let mut cut = Cut { next: Vec::new() };
        let mut seats = Vec::new();
        let mut notes = Vec::new();
        for (number, member) in self.crew.iter().enumerate() {
            let stands = match member.recalled {
                Some(next) => next,
                None => self.stands(&course.recorder(), number),
            };
            cut.next.push(stands);
            if course.recorder().is_liar(number) && stands == course.plan.participants[number].activations {
                return Err(RunFailure::Other(NOTHING_LEFT.into()));
            }
            let (one, entry) = (fallen.iter().find(|one| one.number == number), &course.entries[number]);
            seats.push(match (one, &entry.on_failure) {
                (Some(one), OnFailure::Substitute(program)) => {
                    let entry = entry.replaced_by(program);
                    let text = format!(
                        "{} takes over at activation {stands} from afresh: the one before {}",
                        entry.program,
                        one.first_line()
                    );
                    notes.push((number, text));
                    Seat::New(Box::new(entry), None)
                }
                _ => Seat::Same(None),
            });
        }
        // The substitute sees again what its predecessor was shown last.
        course.recorder().expect_again()?;
        let mut missing = self.move_everybody(course, &cut, seats)?;
        // A restart must not bring back a participant that was replaced.
        course.last_checkpoint = None;
        let mut at = 0;
        for (number, text) in notes {
            course.recorder().renew(number);
            at = course.plan.participants[number].sample_time.instant(cut.next[number]);
            Self::note(course, EventKind::Substitution, at, number, text)?;
        }
        if missing.is_empty()
            && let Some(one) = keep_for_restarts(self, course, course.time(at), cut)?
        {
            // A participant that lives but cannot save its state does no harm as long as the run need not go back.
            if self.crew[one.number].process.ended().is_some() {
                missing.push(one);
            }
        }
        Ok(missing)
    }

    /// Records `text` about participant number `number` on the tape, and reports it to the user.
    fn note(course: &mut Course, kind: EventKind, at: Ticks, number: usize, text: String) -> Result<(), RunFailure> {
        let name = course.plan.participants[number].name.clone();
        let said = format!("participant `{name}`: {text}");
        course.options.progress.say(&said);
        course.recovered.push(said);
        let event = Event {
            time: course.time(at),
            kind,
            participant: Some(name),
            text,
        };
        Ok(course.recorder().event(&event)?)
    }
}
