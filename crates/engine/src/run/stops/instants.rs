//! Checks of the instants on the command line against the length of the run.

use lockstep::time::{Rational, Ticks, Timebase};

use super::schedule::CHECKPOINTS_MAX;
use crate::run::options::Options;
use crate::run::outcome::RunFailure;

/// Refuses instants at which a run of `duration`, which ends at tick `end`, does not pause, before anything is
/// started.
pub(crate) fn check(duration: Rational, end: Ticks, timebase: &Timebase, options: &Options) -> Result<(), RunFailure> {
    let refuse = |option: &'static str, time: Rational, reason: String| {
        let value = time.to_string();
        Err(RunFailure::Option { option, value, reason })
    };
    let late = |time: Rational| not_before_end(time, duration, end, timebase);
    let begin = options.origin.as_ref().map(|origin| origin.checkpoint.time);
    let instants = [
        ("--pause-at", &options.pause_at),
        ("--checkpoint-at", &options.checkpoint_at),
    ];
    for (option, times) in instants {
        for &time in times {
            if time.is_negative() {
                return refuse(option, time, "is before the start: give 0 s or more".into());
            }
            if let Some(end) = late(time) {
                return refuse(option, time, too_late(&end));
            }
            if let Some(begin) = begin.filter(|begin| time < *begin) {
                let reason = format!("is before t = {begin}, at which the run continues: give a later time");
                return refuse(option, time, reason);
            }
        }
    }
    let option = "--checkpoint-every";
    let Some(every) = options.checkpoint_every else {
        return Ok(());
    };
    if !every.is_positive() {
        return refuse(option, every, "is not above zero: give a time such as 5s".into());
    }
    if let Some(end) = late(every) {
        return refuse(option, every, format!("makes no checkpoint before {end}: give less"));
    }
    // If the product overflows, it is longer than every run.
    if every
        .checked_mul(CHECKPOINTS_MAX as i64)
        .is_some_and(|most| most < duration)
    {
        let reason = format!("makes more than {CHECKPOINTS_MAX} checkpoints in {duration}: give more");
        return refuse(option, every, reason);
    }
    Ok(())
}

/// Refuses `--from` at an instant at which a run of `duration` does not pause before its end at tick `end`.
pub(crate) fn check_from(
    from: Rational,
    duration: Rational,
    end: Ticks,
    timebase: &Timebase,
) -> Result<(), RunFailure> {
    match not_before_end(from, duration, end, timebase) {
        None => Ok(()),
        Some(end) => Err(RunFailure::Option {
            option: "--from",
            value: from.to_string(),
            reason: too_late(&end),
        }),
    }
}

/// The end of a run of `duration` in words, if the run does not pause at `time` before it. A run pauses at a whole tick:
/// at the first one at or after an instant.
fn not_before_end(time: Rational, duration: Rational, end: Ticks, timebase: &Timebase) -> Option<String> {
    if time >= duration {
        return Some(format!("the end at {duration}"));
    }
    let rounded_up = timebase.ceil(time).is_ok_and(|ticks| ticks >= end);
    rounded_up.then(|| format!("the end at {duration} in ticks of {}", timebase.tick()))
}

fn too_late(end: &str) -> String {
    format!("is not before {end}: give an earlier time, or a longer --duration")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn branch_that_rounds_up_to_the_end_is_refused_with_from() {
        let timebase = Timebase::from_times([time("1 ms")]).unwrap();
        let checked = |from| check_from(time(from), time("10 s"), 10_000, &timebase);
        assert!(checked("9.999 s").is_ok());
        for (from, part) in [("10 s", "the end at 10 s"), ("9.9991 s", "in ticks of 1 ms")] {
            let refused = checked(from).unwrap_err();
            assert_eq!(refused.exit_code(), 2);
            let refused = refused.to_string();
            for part in ["--from", &time(from).to_string(), part, "--duration"] {
                assert!(refused.contains(part), "{part}: {refused}");
            }
        }
    }

    fn refusal(change: impl FnOnce(&mut Options)) -> Option<String> {
        let mut options = Options::default();
        change(&mut options);
        let timebase = Timebase::from_times([time("1 ms")]).unwrap();
        let checked = check(time("10 s"), 10_000, &timebase, &options);
        checked.err().map(|failure| {
            assert_eq!(failure.exit_code(), 2);
            failure.to_string()
        })
    }

    fn time(text: &str) -> Rational {
        text.parse().unwrap()
    }

    #[test]
    fn instant_outside_the_run_is_refused_with_option_and_value() {
        for text in ["0 s", "1 ns", "9.999 s"] {
            assert_eq!(
                refusal(|options| options.checkpoint_at = vec![time("1 s"), time(text)]),
                None
            );
            assert_eq!(refusal(|options| options.pause_at = vec![time(text)]), None);
        }
        for (text, part) in [
            ("-1 ns", "before the start"),
            ("10 s", "the end at 10 s"),
            ("9.9991 s", "the end at 10 s in ticks of 1 ms"),
            ("1e9 h", "the end"),
        ] {
            for (option, refused) in [
                (
                    "--checkpoint-at",
                    refusal(|options| options.checkpoint_at = vec![time("1 s"), time(text)]),
                ),
                ("--pause-at", refusal(|options| options.pause_at = vec![time(text)])),
            ] {
                let refused = refused.unwrap();
                for part in [option, &time(text).to_string(), part] {
                    assert!(refused.contains(part), "{part}: {refused}");
                }
            }
        }
    }

    #[test]
    fn interval_without_checkpoints_or_with_too_many_is_refused() {
        for text in ["1 ms", "9.999 s"] {
            assert_eq!(
                refusal(|options| options.checkpoint_every = Some(time(text))),
                None,
                "{text}"
            );
        }
        for (text, part) in [
            ("0 s", "above zero"),
            ("-1 s", "above zero"),
            ("10 s", "no checkpoint"),
            ("9.9991 s", "no checkpoint before the end at 10 s in ticks of 1 ms"),
            ("2 h", "no checkpoint"),
            ("999 us", "more than 10000"),
            ("1 ns", "more than 10000"),
        ] {
            let refused = refusal(|options| options.checkpoint_every = Some(time(text))).unwrap();
            for part in ["--checkpoint-every", &time(text).to_string(), part] {
                assert!(refused.contains(part), "{part}: {refused}");
            }
        }
    }
}
