//! A participant in Rust as a table, and back: what a plug-in in Rust is to its host.

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use std::sync::{Arc, Mutex};

use lockstep::participant::{
    Failure, Inputs, Interface, Kind, Line, Log, Outputs, ParameterError, Participant, Setup, Sink, Step, Termination,
};
use plugin::{Foreign, table};

lockstep::message! {
    struct Value {
        value: f64 = "m" in "N",
        table: [[f32; 2]; 3] = "1",
    }
}

struct Sum {
    sum: f64,
    panics_at: u64,
}

impl Participant for Sum {
    fn interface(&self) -> Interface {
        Interface::new(Kind::Sampled)
            .input::<Value>("in")
            .optional_input::<Value>("more")
            .output::<Value>("out")
            .output::<Value>("kept")
    }

    fn initialise(&mut self, t: f64, outputs: &mut Outputs) -> Result<(), Failure> {
        outputs.get_mut::<Value>(0).value = t;
        outputs.log(format_args!("begins with {}", self.sum));
        Ok(())
    }

    fn step(&mut self, step: &Step, inputs: &Inputs, outputs: &mut Outputs) -> Result<(), Failure> {
        assert!(step.index != self.panics_at, "step {} is too many", step.index);
        self.sum += inputs.get::<Value>(0).value + f64::from(inputs.get::<Value>(1).table[2][1]);
        if !self.sum.is_finite() {
            return Err(format!("the sum is {}", self.sum).into());
        }
        outputs.get_mut::<Value>(0).value = self.sum;
        Ok(())
    }

    fn terminate(&mut self, why: Termination, log: &Log) {
        log.write(format_args!("{} with {}", why.name(), self.sum));
        assert!(self.panics_at != 1000, "no end");
    }

    fn save(&self) -> Option<Vec<u8>> {
        Some(self.sum.to_le_bytes().to_vec())
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), Failure> {
        self.sum = f64::from_le_bytes(state.try_into()?);
        Ok(())
    }
}

fn make(setup: &Setup) -> Result<Box<dyn Participant>, ParameterError> {
    let panics_at = setup.parameters.get("panics-at").map_or(Ok(u64::MAX), |value| {
        let number = value.as_integer().and_then(|number| u64::try_from(number).ok());
        number.ok_or_else(|| ParameterError::new("panics-at", format!("{value} is no activation")))
    })?;
    Ok(Box::new(Sum { sum: 0.0, panics_at }))
}

plugin::export! {
    "sum" => make,
    "other" => |_: &Setup| Err(ParameterError::new("", "there is no other")),
}

fn foreign(name: &str, parameters: &str) -> Result<Box<dyn Participant>, ParameterError> {
    let tables = (0..).map(|index| escapement_plugin(index));
    // SAFETY: the tables are those of the macro, which stay to the end.
    let mut checked = tables.map(|table| unsafe { table::check(table) }.unwrap());
    let table = checked.find(|table| table.name() == name).unwrap();
    let setup = Setup {
        name: "here".into(),
        parameters: parameters.parse().unwrap(),
        seed: 1,
        period: 0.1,
        offset: 0.0,
    };
    Foreign::make(table, &setup)
}

fn step(index: u64) -> Step {
    Step {
        index,
        t: index as f64 * 0.1,
        t_next: (index + 1) as f64 * 0.1,
        period: 0.1,
    }
}

thread_local! {
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: everything is done by the system's allocator.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promise is passed on.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise is passed on.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn table_behaves_like_its_participant() {
    let mut own = make(&Setup {
        name: "here".into(),
        parameters: toml::Table::new(),
        seed: 1,
        period: 0.1,
        offset: 0.0,
    })
    .unwrap();
    let mut foreign = foreign("sum", "").unwrap();
    let interface = own.interface();
    assert_eq!(foreign.interface(), interface);
    let mut inputs = Inputs::zeroed(&interface);
    let (mut one, mut two) = (Outputs::zeroed(&interface), Outputs::zeroed(&interface));
    // A field that no call writes keeps its value.
    one.get_mut::<Value>(1).value = 7.0;
    two.get_mut::<Value>(1).value = 7.0;
    own.initialise(0.5, &mut one).unwrap();
    foreign.initialise(0.5, &mut two).unwrap();
    for index in 0..100 {
        inputs.get_mut::<Value>(0).value = index as f64 * 0.37;
        inputs.get_mut::<Value>(1).table[2][1] = 0.1;
        own.step(&step(index), &inputs, &mut one).unwrap();
        let before = ALLOCATIONS.get();
        foreign.step(&step(index), &inputs, &mut two).unwrap();
        assert_eq!(ALLOCATIONS.get(), before, "a step took memory");
        for port in 0..2 {
            assert_eq!(one.bytes_mut(port), two.bytes_mut(port));
        }
    }
    let state = foreign.save();
    assert_eq!(state, own.save());
    let mut again = self::foreign("sum", "").unwrap();
    again.restore(&state.unwrap()).unwrap();
    assert_eq!(again.save(), own.save());
    let refused = again.restore(&[1, 2, 3]).unwrap_err().to_string();
    assert!(refused.contains("slice"), "{refused}");
}

#[test]
fn table_returns_refusals_failures_and_panics_verbatim() {
    let refused = foreign("other", "").err().unwrap();
    assert_eq!((&*refused.key, &*refused.reason), ("", "there is no other"));
    let refused = foreign("sum", "panics-at = -1").err().unwrap();
    assert_eq!((&*refused.key, &*refused.reason), ("panics-at", "-1 is no activation"));
    let mut foreign = foreign("sum", "panics-at = 3").unwrap();
    let interface = foreign.interface();
    let (mut inputs, mut outputs) = (Inputs::zeroed(&interface), Outputs::zeroed(&interface));
    for index in 0..3 {
        foreign.step(&step(index), &inputs, &mut outputs).unwrap();
    }
    let error = foreign.step(&step(3), &inputs, &mut outputs).unwrap_err().to_string();
    assert!(error.contains("it panicked: step 3 is too many"), "{error}");
    // What has panicked may be torn.
    let error = foreign.step(&step(4), &inputs, &mut outputs).unwrap_err().to_string();
    assert!(error.contains("panicked before"), "{error}");
    assert_eq!(foreign.save(), None);
    let mut foreign = self::foreign("sum", "").unwrap();
    inputs.get_mut::<Value>(0).value = f64::INFINITY;
    let error = foreign.step(&step(0), &inputs, &mut outputs).unwrap_err().to_string();
    assert_eq!(error, "the sum is inf");
}

#[derive(Default)]
struct RecordedLines(Mutex<Vec<String>>);

impl Sink for RecordedLines {
    fn write_line(&self, line: &Line<'_>) {
        self.0.lock().unwrap().push(line.to_string());
    }
}

#[test]
fn table_passes_log_lines_and_termination() {
    let lines = Arc::new(RecordedLines::default());
    for (why, parameters, last) in [
        (
            Some(Termination::Finished),
            "",
            vec!["here at t = 9 s: finished with 0"],
        ),
        (
            Some(Termination::Replaced),
            "",
            vec!["here at t = 9 s: replaced with 0"],
        ),
        (
            Some(Termination::Stopped),
            "panics-at = 1000",
            vec![
                "here at t = 9 s: stopped with 0",
                "here at t = 9 s: its function `terminate` failed: it panicked: no end",
            ],
        ),
        // A participant that was never initialised gets no termination.
        (None, "", vec![]),
    ] {
        let log = Log::new("here", Some(lines.clone()));
        let mut foreign = foreign("sum", parameters).unwrap();
        let mut outputs = Outputs::zeroed(&foreign.interface());
        outputs.set_log(log.clone());
        let mut expected = vec![];
        if let Some(why) = why {
            foreign.initialise(0.5, &mut outputs).unwrap();
            foreign.terminate(why, &log.at(9.0));
            expected.push("here at t = 0.5 s: begins with 0");
        }
        drop(foreign);
        expected.extend(last);
        assert_eq!(std::mem::take(&mut *lines.0.lock().unwrap()), expected);
    }
}
