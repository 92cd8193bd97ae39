//! A short undisturbed run: it must succeed under any load of the machine.

use std::time::Duration;

use super::inspect::{TapeExtent, ensure_nothing_left};
use super::round::ReferenceRuns;
use super::signals::{Running, ensure_no_process_left};
use super::{CheckResult, Rng, Tally, ensure, ensure_equal};
use crate::program::Folder;

/// The number of scenarios of a seed.
const CASES: u64 = 18;

/// Start `number` of `seed`.
pub(super) fn run(seed: u64, number: u64, references: &mut ReferenceRuns, tally: &mut Tally) -> CheckResult<()> {
    let mut rng = Rng::new(seed, &format!("start {number}"));
    let at = rng.below(CASES);
    let (case, reference) = references.get(seed, at, true, tally)?;
    let folder = Folder::new("start");
    let out = folder.path().join("run");
    let mut arguments = vec!["run".to_owned()];
    arguments.extend(case.arguments(folder.path()));
    arguments.extend(["--out".into(), out.display().to_string(), "--quiet".into()]);
    let wait = rng.choose(&["auto", "auto", "yield", "sleep"]);
    arguments.extend(["--wait".into(), wait.into()]);
    let token = format!("start-{seed}-{number}-{}", std::process::id());
    tally.runs += 1;
    let ended = Running::start(&arguments, folder.path(), &token).finish()?;
    let check = || -> CheckResult<()> {
        ensure_no_process_left(&token, Duration::ZERO)?;
        ensure_nothing_left(&folder.path().join("scratch"), false)?;
        ensure_equal("the exit code", &ended.code, &Some(case.code))?;
        // A notice that there was no progress for a while is justified only on a heavily loaded machine.
        let wrong = |line: &str| line.starts_with("error") || line.starts_with("warning") || line.contains("panicked");
        ensure(!ended.err.lines().any(wrong), || "it reports an error".into())?;
        ensure_equal("the tape", &reference.part(&out, false)?, &TapeExtent::Whole)?;
        reference.check_report(&out, case.code, case.code, TapeExtent::Whole)?;
        Ok(())
    };
    check().map_err(|reason| {
        let kept = folder.keep();
        format!("{reason}: {ended:?}\n  case {at}, kept in {}", kept.display())
    })
}
