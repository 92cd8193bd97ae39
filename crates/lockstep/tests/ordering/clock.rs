//! The clock: who dozes at the horizon sees it move, and an order to leave is seen by who is woken for it.

use testing::loom::thread;

use crate::control::Waiting;
use crate::model::{Board, Event, check};
use crate::time::Ticks;
use crate::transport::lock_free::board::Get;
use crate::transport::lock_free::clock::{GO_ON, Horizon, Order, give, order};
use crate::waiting::Patience;

/// A participant goes along with the horizon until it is told to leave. `ring`: the orchestrator wakes it after each change.
fn go_along(ring: bool) {
    check(3, move || {
        let (horizon, orders) = (Board::new(Ticks::MIN as u64), Board::new(GO_ON));
        let mut event = Event::new();
        let (seen_horizon, seen_orders, bell) = (horizon.clone(), orders.clone(), event.clone());
        let orchestrator = thread::spawn(move || {
            let mut clock = Horizon::START;
            // Backwards it does not go.
            for to in [20, 10] {
                clock.extend(&*horizon, to);
                assert_eq!(clock.now(), 20);
            }
            if ring {
                bell.ring();
            }
            give(&*orders, Order::Leave);
            if ring {
                bell.ring();
            }
        });
        let mut patience = Patience::new(Waiting { spins: 0, yields: 0 });
        let mut seen = Ticks::MIN;
        while order(&*seen_orders) != Order::Leave {
            let now: Ticks = seen_horizon.get();
            assert!(seen <= now && (now == Ticks::MIN || now == 20), "{now} after {seen}");
            if now == seen {
                patience.doze(&mut event).expect("an event");
            }
            seen = now;
        }
        assert_eq!(Get::<Ticks>::get(&*seen_horizon), 20, "the horizon was moved before");
        orchestrator.join().expect("it told everything");
    });
}

#[test]
fn horizon_and_orders_reach_who_dozes() {
    go_along(true);
}

#[test]
#[should_panic(expected = "deadlock")]
fn without_the_bell_they_do_not() {
    go_along(false);
}
