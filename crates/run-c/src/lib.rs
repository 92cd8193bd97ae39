//! The C ABI of a program that drives runs: `escapement-run.h` declares and documents these functions.
//!
//! [`run_functions!`] defines them in a library, with that library's catalogue; their implementation is in this crate.

#[doc(hidden)]
pub mod run;
#[doc(hidden)]
pub mod step_pause;

pub use run::{Checkpoint, Options, Outcome, Sample};

/// The version of the ABI: `ESCAPEMENT_RUN_ABI`.
pub const ABI: u32 = 1;

/// Defines the functions of `escapement-run.h` in a library. The first argument fills the catalogue; the second one is the version of
/// Escapement.
///
/// ```
/// use engine::Catalogue;
///
/// fn contents(catalogue: Catalogue) -> Catalogue {
///     catalogue
/// }
///
/// run_c::run_functions!(contents, "0.1.0");
/// # fn main() {}
/// ```
#[macro_export]
macro_rules! run_functions {
    ($contents:path, $version:expr) => {
        const _: () = {
            #[allow(clippy::wildcard_imports, reason = "these are the types of the functions below")]
            use $crate::__private::*;

            fn catalogue() -> Arc<Catalogue> {
                static ALL: OnceLock<Arc<Catalogue>> = OnceLock::new();
                ALL.get_or_init(|| Arc::new($contents(Catalogue::new($version)))).clone()
            }

            $crate::functions! {
                fn escapement_run_abi() -> u32 = $crate::ABI;
                fn escapement_run_start(scenario: *const c_char, options: *const Options, run: *mut *mut Run) -> i32
                    = calls::start(catalogue, scenario, options, run);
                fn escapement_run_error(run: *const Run) -> *const c_char = calls::error(run);
                fn escapement_run_now(run: *const Run) -> f64 = calls::now(run);
                fn escapement_run_is_over(run: *const Run) -> u32 = calls::is_over(run);
                fn escapement_run_to(run: *mut Run, time: f64) -> i32 = calls::to(run, time);
                fn escapement_run_step(run: *mut Run) -> i32 = calls::step(run);
                fn escapement_run_to_step(run: *mut Run, participant: *const c_char, reached: *mut u32) -> i32
                    = step_calls::to_step(run, participant, reached);
                fn escapement_run_read_input(run: *mut Run, port: *const c_char, sample: *mut Sample) -> i32
                    = step_calls::read_input(run, port, sample);
                fn escapement_run_set_output(run: *mut Run, port: *const c_char, bytes: *const c_void, size: u64) -> i32
                    = step_calls::set_output(run, port, bytes, size);
                fn escapement_run_log(run: *mut Run, participant: *const c_char) -> *const c_char
                    = step_calls::log(run, participant);
                fn escapement_run_newest(run: *mut Run, port: *const c_char, sample: *mut Sample) -> i32
                    = calls::newest(run, port, sample);
                fn escapement_run_field(run: *mut Run, port: *const c_char, field: *const c_char, values: *mut f64, count: u32) -> i32
                    = calls::field(run, port, field, values, count);
                fn escapement_run_set(run: *mut Run, port: *const c_char, bytes: *const c_void, size: u64) -> i32
                    = calls::set(run, port, bytes, size);
                fn escapement_run_figure(run: *mut Run, name: *const c_char, value: *mut f64) -> i32
                    = calls::figure(run, name, value);
                fn escapement_run_save(run: *mut Run, checkpoint: *mut *mut Checkpoint) -> i32 = calls::save(run, checkpoint);
                fn escapement_run_restore(run: *mut Run, checkpoint: *const Checkpoint) -> i32 = calls::restore(run, checkpoint);
                fn escapement_run_checkpoint_free(checkpoint: *mut Checkpoint) = calls::checkpoint_free(checkpoint);
                fn escapement_run_end(run: *mut Run, outcome: *mut Outcome) -> i32 = calls::end(run, outcome);
                fn escapement_run_free(run: *mut Run) = calls::free(run);
            }
        };
    };
}

/// Defines the functions: each calls the expression given for it, and nothing else.
#[doc(hidden)]
#[macro_export]
macro_rules! functions {
    ($(fn $name:ident($($argument:ident: $type:ty),*) $(-> $result:ty)? = $call:expr;)*) => {
        $(
            #[unsafe(no_mangle)]
            unsafe extern "C" fn $name($($argument: $type),*) $(-> $result)? {
                // SAFETY: a program in C passes the arguments that the header prescribes, which are the conditions of what is called.
                #[allow(unused_unsafe, reason = "one calls nothing")]
                unsafe { $call }
            }
        )*
    };
}

/// For the functions that [`run_functions!`] writes.
#[doc(hidden)]
pub mod __private {
    pub use std::ffi::{c_char, c_void};
    pub use std::sync::{Arc, OnceLock};

    pub use engine::Catalogue;

    pub use crate::run::{self as calls, Checkpoint, Options, Outcome, Run, Sample};
    pub use crate::step_pause as step_calls;
}
