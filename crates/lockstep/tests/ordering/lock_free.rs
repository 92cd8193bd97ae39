//! The files under test, with the model checker's atomics in place of the processor's.

#[path = "../../src/transport/lock_free/board.rs"]
pub mod board;
#[path = "../../src/transport/lock_free/clock.rs"]
pub mod clock;
#[path = "../../src/transport/lock_free/entries.rs"]
pub mod entries;
#[path = "../../src/transport/lock_free/room.rs"]
pub mod room;
#[path = "../../src/transport/lock_free/slots.rs"]
pub mod slots;
#[path = "sync.rs"]
pub mod sync;
#[path = "../../src/transport/lock_free/wait_reason.rs"]
pub mod wait_reason;
#[path = "../../src/transport/lock_free/words.rs"]
pub mod words;
