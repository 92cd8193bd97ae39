//! Foreign code that changes the floating-point modes changes its own only.

use foreign_calls::{FloatModes, Guard, with_default_modes};

unsafe extern "C" {
    fn fesetround(mode: i32) -> i32;
    fn fegetround() -> i32;
}

const UPWARD: i32 = if cfg!(target_arch = "aarch64") {
    0x40_0000
} else {
    0x800
};

fn set(mode: i32) {
    // SAFETY: a function of the C library, which sets the modes of this thread.
    assert_eq!(unsafe { fesetround(mode) }, 0);
}

fn current() -> i32 {
    // SAFETY: a function of the C library, which reads the modes of this thread.
    unsafe { fegetround() }
}

#[test]
fn callee_keeps_its_modes_to_itself() {
    let (one, other) = (Guard::allowing_exit(), Guard::new("other", str::to_owned));
    one.call("step", || set(UPWARD));
    assert_eq!(current(), 0);
    assert_eq!(other.call("step", current), 0);
    assert_eq!(one.call("step", current), UPWARD);
    assert_ne!(one.modes(), FloatModes::default());
    assert_eq!(other.modes(), FloatModes::default());
    other.set_modes(one.modes());
    assert_eq!(other.call("step", current), UPWARD);
}

#[test]
fn modes_follow_the_stack_of_calls() {
    let (outer, inner) = (Guard::allowing_exit(), Guard::allowing_exit());
    outer.call("step", || {
        set(UPWARD);
        assert_eq!(with_default_modes(current), 0);
        assert_eq!(inner.call("step", current), 0);
        assert_eq!(current(), UPWARD);
    });
    assert_eq!(current(), 0);
}

#[test]
fn modes_are_back_after_a_panic() {
    let guard = Guard::allowing_exit();
    let panicked = std::panic::catch_unwind(|| {
        guard.call("step", || {
            set(UPWARD);
            panic!("on purpose");
        })
    });
    assert!(panicked.is_err());
    assert_eq!(current(), 0);
}

#[test]
fn modes_of_the_program_are_taken() {
    set(UPWARD);
    let guard = Guard::allowing_exit();
    guard.set_modes(FloatModes::take());
    assert_eq!(current(), 0);
    assert_eq!(guard.call("step", current), UPWARD);
}
