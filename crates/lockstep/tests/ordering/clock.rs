//! The clock: a participant that sleeps at the horizon sees it move, and sees the command to terminate when it is woken.

use testing::loom::thread;

use crate::backoff::Backoff;
use crate::control::WaitStrategy;
use crate::model::{Board, Event, check};
use crate::time::Ticks;
use crate::transport::lock_free::board::Get;
use crate::transport::lock_free::clock::{Command, Horizon, RUN, command, set_command};

/// A participant follows the horizon until the command to terminate. `notify`: the orchestrator wakes it after each change.
fn follow_horizon(notify: bool) {
    check(3, move || {
        let (horizon, commands) = (Board::new(Ticks::MIN as u64), Board::new(RUN));
        let mut event = Event::new();
        let (seen_horizon, seen_commands, notifier) = (horizon.clone(), commands.clone(), event.clone());
        let orchestrator = thread::spawn(move || {
            let mut clock = Horizon::START;
            // Backwards it does not go.
            for to in [20, 10] {
                clock.extend(&*horizon, to);
                assert_eq!(clock.now(), 20);
            }
            if notify {
                notifier.notify();
            }
            set_command(&*commands, Command::Terminate);
            if notify {
                notifier.notify();
            }
        });
        let mut backoff = Backoff::new(WaitStrategy { spins: 0, yields: 0 });
        let mut seen = Ticks::MIN;
        while command(&*seen_commands) != Command::Terminate {
            let now: Ticks = seen_horizon.get();
            assert!(seen <= now && (now == Ticks::MIN || now == 20), "{now} after {seen}");
            if now == seen {
                backoff.sleep(&mut event).expect("an event");
            }
            seen = now;
        }
        assert_eq!(Get::<Ticks>::get(&*seen_horizon), 20, "the horizon was moved before");
        orchestrator.join().expect("it has sent everything");
    });
}

#[test]
fn sleeping_participant_sees_horizon_and_command() {
    follow_horizon(true);
}

#[test]
#[should_panic(expected = "deadlock")]
fn participant_without_notification_sleeps_forever() {
    follow_horizon(false);
}
