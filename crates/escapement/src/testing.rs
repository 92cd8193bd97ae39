//! Unit tests of participants: stepping by hand, and checks of the properties that every run relies on.
//!
//! ```
//! use escapement::prelude::*;
//! use escapement::testing::{Harness, assert_repeats, assert_resumes};
//!
//! escapement::message! {
//!     /// A signal.
//!     pub struct Signal {
//!         /// Its value.
//!         pub value: f64 = "V",
//!     }
//! }
//!
//! /// A low pass of the first order.
//! struct LowPass {
//!     ports: Ports,
//!     raw: InputPort<Signal>,
//!     smooth: OutputPort<Signal>,
//!     state: f64,
//! }
//!
//! impl LowPass {
//!     fn new() -> LowPass {
//!         let mut ports = Ports::new(Kind::Sampled);
//!         LowPass { raw: ports.input("raw"), smooth: ports.output("smooth"), ports, state: 0.0 }
//!     }
//! }
//!
//! impl Participant for LowPass {
//!     fn interface(&self) -> Interface {
//!         self.ports.interface()
//!     }
//!     fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
//!         self.state += (inputs[self.raw].value - self.state) * (step.period / 0.1);
//!         outputs[self.smooth].value = self.state;
//!         Ok(())
//!     }
//!     fn save(&self) -> Option<Vec<u8>> {
//!         state::to_bytes(&self.state)
//!     }
//!     fn restore(&mut self, bytes: &[u8]) -> Result<(), Failure> {
//!         self.state = state::from_bytes(bytes)?;
//!         Ok(())
//!     }
//! }
//!
//! // By hand, step by step.
//! let mut low_pass = Harness::new(LowPass::new(), "10 ms");
//! low_pass.set("raw", Signal { value: 1.0 });
//! low_pass.step();
//! assert!((low_pass.value("smooth.value") - 0.1).abs() < 1e-15);
//! low_pass.steps(99);
//! assert!(low_pass.get::<Signal>("smooth").value > 0.9999);
//! assert_eq!(low_pass.t(), 1.0);
//!
//! // What checkpoints and tapes rely on.
//! let wave = |harness: &mut Harness| harness.set_value("raw.value", harness.t().sin());
//! let make = || Harness::new(LowPass::new(), "10 ms");
//! assert_resumes(make, 100, wave);
//! assert_repeats(make, 100, wave);
//! ```
//!
//! To check that a step does not allocate heap memory, install the counting allocator in the test program:
//!
//! ```
//! # use escapement::prelude::*;
//! use escapement::testing::{Counting, Harness};
//!
//! #[global_allocator]
//! static ALLOCATOR: Counting = Counting;
//! # struct Idle;
//! # impl Participant for Idle {
//! #     fn interface(&self) -> Interface {
//! #         Interface::new(Kind::Sampled)
//! #     }
//! #     fn step(&mut self, _: &Step, _: &Inputs, _: &mut Outputs) -> Result<(), Failure> {
//! #         Ok(())
//! #     }
//! # }
//!
//! Harness::new(Idle, "10 ms").assert_allocates_nothing(100);
//! ```

pub use allocation::Counting;
use std::sync::{Arc, Mutex, PoisonError};

use lockstep::participant::{
    Inputs, Interface, Kind, Line, Log, Outputs, ParameterError, Participant, Setup, Sink, Step, Termination,
};
use lockstep::port::{Descriptor, Field, Message};
use lockstep::time::Rational;

/// A participant with its ports, without process, scenario or clock.
///
/// Inputs keep the values set last, initially zeros. Every error panics with a message that names the port, the field or
/// the failure, because the harness is for tests.
pub struct Harness {
    participant: Box<dyn Participant>,
    interface: Interface,
    inputs: Inputs,
    outputs: Outputs,
    period: Rational,
    next: u64,
    lines: Arc<RecordedLines>,
}

/// The participant's log.
#[derive(Default)]
struct RecordedLines(Mutex<Vec<String>>);

impl Sink for RecordedLines {
    fn write_line(&self, line: &Line<'_>) {
        self.0
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .push(line.to_string());
    }
}

impl Harness {
    /// Creates a harness of `participant`, initialised at 0 s, with a sample time such as `"10 ms"` or `"1 kHz"`.
    ///
    /// # Panics
    /// When the sample time is invalid, when the ports cannot be used, or when the participant's initialisation fails.
    #[track_caller]
    pub fn new(participant: impl Participant + 'static, period: &str) -> Harness {
        let mut participant: Box<dyn Participant> = Box::new(participant);
        let period: Rational = period.parse().unwrap_or_else(|error| panic!("{error}"));
        assert!(period.is_positive(), "a sample time is longer than `{period}`");
        let interface = participant.interface();
        if let Err(error) = interface.validate() {
            panic!("{error}");
        }
        let (inputs, mut outputs) = (Inputs::zeroed(&interface), Outputs::zeroed(&interface));
        let lines = Arc::new(RecordedLines::default());
        outputs.set_log(Log::new("tested", Some(lines.clone())).at(0.0));
        if let Err(failure) = participant.initialise(0.0, &mut outputs) {
            panic!("initialise: {failure}");
        }
        let harness = Harness {
            participant,
            interface,
            inputs,
            outputs,
            period,
            next: 0,
            lines,
        };
        if harness.interface.kind == Kind::Continuous {
            harness.assert_finite("initialise");
        }
        harness
    }

    /// Creates a harness of the participant that `make` returns for the table `parameters`, which is written as in a
    /// scenario, with the seed 0.
    ///
    /// # Panics
    /// When the table is invalid or `make` rejects it, and as [`Harness::new`].
    #[track_caller]
    pub fn made(
        make: impl Fn(&Setup) -> Result<Box<dyn Participant>, ParameterError>,
        parameters: &str,
        period: &str,
    ) -> Harness {
        let setup = Setup {
            name: "tested".to_owned(),
            parameters: parameters.parse().unwrap_or_else(|error| panic!("parameters: {error}")),
            seed: 0,
            period: period
                .parse::<Rational>()
                .unwrap_or_else(|error| panic!("{error}"))
                .seconds(),
            offset: 0.0,
        };
        Harness::new(
            make(&setup).unwrap_or_else(|error| panic!("parameters: {error}")),
            period,
        )
    }

    /// The instant of the next step, s.
    pub fn t(&self) -> f64 {
        self.instant(self.next)
    }

    /// Sets the input `port` to `message`.
    ///
    /// # Panics
    /// When the input does not exist, or carries another message.
    #[track_caller]
    pub fn set<M: Message>(&mut self, port: &str, message: M) {
        let number = self.input(port);
        same::<M>(port, &self.interface.inputs[number].descriptor);
        *self.inputs.get_mut(number) = message;
    }

    /// Sets a field of an input, or one element of it, to `value`: `"raw.value"`, `"command.torque[2]"`. The name of a
    /// field alone sets all of its elements.
    ///
    /// # Panics
    /// When the name does not exist.
    #[track_caller]
    pub fn set_value(&mut self, name: &str, value: f64) {
        let (port, field) = split(name);
        let number = self.input(port);
        let (field, elements) = named(&self.interface.inputs[number].descriptor, name, field);
        let (start, size) = (field.range().start, field.element.size());
        for element in elements {
            let bytes = self.inputs.bytes_mut(number);
            field.element.put(value, &mut bytes[start + element * size..][..size]);
        }
    }

    /// The message at the output `port`.
    ///
    /// # Panics
    /// When the output does not exist, or carries another message.
    #[track_caller]
    pub fn get<M: Message>(&self, port: &str) -> M {
        let number = self.output(port);
        same::<M>(port, &self.interface.outputs[number].descriptor);
        *self.outputs.get(number)
    }

    /// One element of an output: `"smooth.value"`, `"motion.position[2]"`.
    ///
    /// # Panics
    /// When the name does not exist, or has several elements.
    #[track_caller]
    pub fn value(&self, name: &str) -> f64 {
        let (port, field) = split(name);
        let number = self.output(port);
        let (field, elements) = named(&self.interface.outputs[number].descriptor, name, field);
        assert!(
            elements.len() == 1,
            "`{name}` has {} elements: name one, such as `{port}.{}`",
            elements.len(),
            field.element_name(elements.start)
        );
        field.value(self.payload(number), elements.start)
    }

    /// The lines of the participant's log, such as `tested at t = 0.02 s: opens`.
    pub fn log(&self) -> Vec<String> {
        self.lines.0.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Terminates the participant. The harness does not prevent further steps; a run never makes any.
    pub fn terminate(&mut self, why: Termination) {
        let log = self.outputs.log_of().clone().at(self.t());
        self.participant.terminate(why, &log);
    }

    /// Performs one step.
    ///
    /// # Panics
    /// When the participant fails, or an output is not finite afterwards, which would end a run.
    #[track_caller]
    pub fn step(&mut self) {
        let step = Step {
            index: self.next,
            t: self.instant(self.next),
            t_next: self.instant(self.next + 1),
            period: self.period.seconds(),
        };
        self.outputs.set_time(step.t);
        let what = "step";
        if let Err(failure) = self.participant.step(&step, &self.inputs, &mut self.outputs) {
            panic!("{what} at {} s: {failure}", step.t);
        }
        self.next += 1;
        self.assert_finite(what);
    }

    /// Performs `count` steps with constant inputs.
    ///
    /// # Panics
    /// As [`Harness::step`].
    #[track_caller]
    pub fn steps(&mut self, count: u64) {
        for _ in 0..count {
            self.step();
        }
    }

    /// Asserts that `count` further steps allocate no heap memory. One step, which may still allocate, is performed first.
    ///
    /// # Panics
    /// When a step allocates, when [`Counting`] is not the allocator of the test program, and as [`Harness::step`].
    #[track_caller]
    pub fn assert_allocates_nothing(&mut self, count: u64) {
        self.step();
        let taken = allocation::allocations_during(|| self.steps(count));
        assert!(
            taken.count == 0,
            "{count} steps took {} pieces from the heap, the largest of {} bytes",
            taken.count,
            taken.largest_bytes
        );
    }

    fn instant(&self, index: u64) -> f64 {
        let instant = i64::try_from(index)
            .ok()
            .and_then(|index| self.period.checked_mul(index));
        instant.expect("a test ends before 63 bits do").seconds()
    }

    #[track_caller]
    fn input(&self, port: &str) -> usize {
        let found = self.interface.inputs.iter().position(|input| input.name == port);
        found.unwrap_or_else(|| {
            let names: Vec<&str> = self.interface.inputs.iter().map(|input| input.name.as_str()).collect();
            panic!("there is no input `{port}`; there are: {}", names.join(", "))
        })
    }

    #[track_caller]
    fn output(&self, port: &str) -> usize {
        let found = self.interface.outputs.iter().position(|output| output.name == port);
        found.unwrap_or_else(|| {
            let names: Vec<&str> = self
                .interface
                .outputs
                .iter()
                .map(|output| output.name.as_str())
                .collect();
            panic!("there is no output `{port}`; there are: {}", names.join(", "))
        })
    }

    fn payload(&self, number: usize) -> &[u8] {
        self.outputs.bytes(number)
    }

    #[track_caller]
    fn assert_finite(&self, after: &str) {
        for (number, output) in self.interface.outputs.iter().enumerate() {
            for field in &output.descriptor.fields {
                for element in 0..field.len() {
                    let value = field.value(self.payload(number), element);
                    assert!(
                        value.is_finite(),
                        "after {after}: `{}.{}` is {value}, which ends a run",
                        output.name,
                        field.element_name(element)
                    );
                }
            }
        }
    }

    /// The raw bytes of all outputs.
    fn bits(&self) -> Vec<u8> {
        (0..self.interface.outputs.len())
            .flat_map(|number| self.payload(number).to_vec())
            .collect()
    }
}

/// Asserts that the same inputs give bit-identical outputs, with two participants from `make` and `steps` steps. `inputs`
/// sets the inputs before each step. It detects hidden state, clocks and the system's random numbers.
///
/// # Panics
/// At the first step at which the outputs differ, with its instant.
#[track_caller]
pub fn assert_repeats(make: impl Fn() -> Harness, steps: u64, mut inputs: impl FnMut(&mut Harness)) {
    let (mut one, mut other) = (make(), make());
    for _ in 0..steps {
        advance_alike(&mut one, &mut other, &mut inputs, "the same inputs gave two answers");
    }
}

/// Asserts that a participant restored from the saved state of another one continues bit-identically: at the start, in the
/// middle and just before the end of `steps` steps.
///
/// # Panics
/// When the participant cannot be saved or rejects its saved state, and at the first step at which the two differ.
#[track_caller]
pub fn assert_resumes(make: impl Fn() -> Harness, steps: u64, mut inputs: impl FnMut(&mut Harness)) {
    for at in [0, 1, steps / 2, steps.saturating_sub(1)] {
        let mut one = make();
        for _ in 0..at {
            inputs(&mut one);
            one.step();
        }
        let saved = one.participant.save();
        let saved = saved.unwrap_or_else(|| panic!("at {} s: the participant cannot be saved", one.t()));
        let mut other = make();
        if let Err(failure) = other.participant.restore(&saved) {
            panic!("at {} s: restore: {failure}", one.t());
        }
        other.next = one.next;
        // A run restores the samples in the connections as well.
        for number in 0..other.interface.outputs.len() {
            other
                .outputs
                .bytes_mut(number)
                .copy_from_slice(one.outputs.bytes(number));
        }
        for _ in at..steps {
            let what = format!("saved after {at} steps and restored");
            advance_alike(&mut one, &mut other, &mut inputs, &what);
        }
    }
}

#[track_caller]
fn advance_alike(one: &mut Harness, other: &mut Harness, inputs: &mut impl FnMut(&mut Harness), what: &str) {
    let t = one.t();
    inputs(one);
    for number in 0..one.interface.inputs.len() {
        other.inputs.bytes_mut(number).copy_from_slice(one.inputs.bytes(number));
    }
    one.step();
    other.step();
    if one.bits() == other.bits() {
        return;
    }
    for (number, output) in one.interface.outputs.iter().enumerate() {
        for field in &output.descriptor.fields {
            for element in 0..field.len() {
                let name = field.element_name(element);
                let values = [&*one, &*other].map(|harness| field.value(harness.payload(number), element));
                assert!(
                    values[0].to_bits() == values[1].to_bits(),
                    "{what}: at {t} s `{}.{name}` is {:e} in one and {:e} in the other",
                    output.name,
                    values[0],
                    values[1]
                );
            }
        }
    }
    panic!("{what}: at {t} s the outputs differ");
}

#[track_caller]
fn split(name: &str) -> (&str, &str) {
    let split = name.split_once('.');
    split.unwrap_or_else(|| panic!("`{name}` names no field: write PORT.FIELD, such as `motion.position`"))
}

#[track_caller]
fn named<'d>(descriptor: &'d Descriptor, name: &str, field: &str) -> (&'d Field, std::ops::Range<usize>) {
    let found = descriptor.resolve(field);
    found.unwrap_or_else(|| {
        let names: Vec<&str> = descriptor.fields.iter().map(|field| field.name.as_str()).collect();
        panic!("there is no `{name}`; fields are: {}", names.join(", "))
    })
}

#[track_caller]
fn same<M: Message>(port: &str, descriptor: &Descriptor) {
    if let Some(difference) = M::descriptor().difference(descriptor) {
        panic!("`{port}` carries another message: {difference}");
    }
}
