//! How the participants of a run are executed: in one loop of this process, or each in a process of its own.

use std::collections::BTreeMap;

use lockstep::control::Timing;
use lockstep::participant::Pending;
use lockstep::plan::Cut;
use lockstep::stepper::Stepper;
use lockstep::time::Ticks;

use super::course::Course;
use super::fallen::Fallen;
use super::outcome::{Ending, RunFailure};
use crate::scenario::Entry;

/// How far one turn came.
pub(super) enum Turn {
    /// There is more to do.
    Going,
    /// Everybody rests where the guide stops, at this instant.
    Rests(Ticks),
    /// The one that is to be held has the inputs of its activation at this instant, and has not stepped.
    Held(Ticks),
    /// The run is over.
    Over(Ending),
    /// A step is to be done beside those of other runs.
    Parked,
}

/// Who sits where when a run is taken up.
pub(super) enum Seat {
    /// The same program, with this state, or the one it has.
    Same(Option<Vec<u8>>),
    /// A new program, with this state, or from afresh.
    New(Box<Entry>, Option<Vec<u8>>),
}

/// Where the wall time of a run went.
#[derive(Default)]
pub(super) struct Account {
    /// Of each participant.
    pub(super) timing: BTreeMap<String, Timing>,
    /// The choice of cores in words.
    pub(super) placement: String,
    /// What participants have said, where it is in no file.
    pub(super) logs: BTreeMap<String, String>,
}

/// The participants of a run, and what they run on.
pub(super) trait Executor {
    /// Lets the participants do a little of what the guide grants, and takes what they have recorded. The error is a failure that
    /// the run may survive.
    fn turn(&mut self, course: &mut Course) -> Result<Turn, Ending>;

    /// From now on steps are left to others where participants allow it: a turn then ends with [`Turn::Parked`].
    fn park(&mut self) {}

    /// The step that waits to be done, if one does.
    fn pending(&mut self) -> Option<Pending<'_>> {
        None
    }

    /// Whether everybody has done exactly what lies before `now`.
    fn rests_at(&self, now: Ticks) -> bool;

    /// The state of participant number `number`, at rest.
    fn save(&mut self, course: &Course, number: usize) -> Result<Vec<u8>, RunFailure>;

    /// At a rest: `seats` are taken, and everybody goes on at `cut`; `back` when that is another cut than the present one.
    /// Inputs that nobody feeds have the values of the course. Gives those who failed on the way.
    ///
    /// # Errors
    /// What has nothing to do with a participant; then nobody is left.
    fn take_up(
        &mut self,
        course: &mut Course,
        cut: &Cut,
        seats: Vec<Seat>,
        back: bool,
    ) -> Result<Vec<Fallen>, RunFailure>;

    /// At a rest: inputs that nobody feeds get the values of the course.
    fn show_inputs(&mut self, course: &mut Course, cut: &Cut) -> Result<Vec<Fallen>, RunFailure>;

    /// Everybody has gone back to `to`.
    fn went_back(&mut self, to: Ticks);

    /// Whether a participant can fail alone, so that others may go on without it.
    fn outlives_failures(&self) -> bool;

    /// What the scenario says about the failure in `ending`: goes on, or gives the ending back.
    fn survive(&mut self, course: &mut Course, ending: Ending) -> Result<(), Ending>;

    /// These participants failed while the run was taken up.
    fn note_fallen(&mut self, fallen: Vec<Fallen>);

    /// At a rest: which process is which participant, in words.
    fn processes(&self) -> String;

    /// At a rest: the failure of a participant that did not stay.
    fn failure(&mut self, course: &Course) -> Option<RunFailure>;

    /// Wall time starts to count again for those who must get on.
    fn renew_patience(&mut self);

    /// From now on turns come to rest before the steps of participant number `number`. The instant of the first one, if that can be.
    fn hold(&mut self, number: usize) -> Option<Ticks> {
        let _ = number;
        None
    }

    /// No participant is held any more.
    fn let_go(&mut self) {}

    /// The one that is held before its step.
    fn held(&self) -> Option<&Stepper> {
        None
    }

    /// Gives output number `output` of the one that is held, in place of its step.
    fn answer(&mut self, output: usize, payload: &[u8]) {
        let _ = (output, payload);
    }

    /// The newest that a participant has said, where the run itself hears it.
    fn said(&self, participant: &str) -> Option<String> {
        let _ = participant;
        None
    }

    /// Tells everybody to leave, and takes what they still have to say.
    fn bring_down(&mut self, course: &mut Course);

    /// Where wall time went.
    fn account(&self) -> Account;
}
