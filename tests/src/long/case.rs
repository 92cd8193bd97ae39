//! The scenarios of the long tests, drawn at random.

use std::fmt::Write as _;
use std::path::Path;

use super::Rng;
use crate::program::{participant, root, spring};

/// The kind of participant in a slot, as far as the tests depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// Has a state, and saves it.
    Stateful,
    /// Can be replaced during the run by `memoryless` without any difference on the tape.
    Damper,
    /// Cannot be saved.
    Unsaved,
}

/// A participant of a case.
#[derive(Debug, Clone)]
pub(super) struct Slot {
    pub(super) name: String,
    pub(super) role: Role,
}

/// A scenario.
#[derive(Debug, Clone)]
pub(super) struct Case {
    pub(super) slots: Vec<Slot>,
    /// Simulated time.
    pub(super) duration_ms: u64,
    /// The exit code of a run that is complete.
    pub(super) code: i32,
    source: Source,
}

#[derive(Debug, Clone)]
enum Source {
    /// A scenario that is written into the folder of the round.
    Text(String),
    /// The stock close capture, cut short.
    Capture,
}

impl Case {
    /// The case `number` of `seed`: the full one, or the short one for a start.
    pub(super) fn random(seed: u64, number: u64, short: bool) -> Case {
        let mut rng = Rng::new(seed, &format!("case {number}"));
        // Every kind occurs in any six consecutive cases.
        match number % 6 {
            0 | 3 => oscillator_ring(&mut rng, 1, short),
            1 => {
                let count = rng.between(2, 3);
                oscillator_ring(&mut rng, count, short)
            }
            2 => one_to_many(&mut rng, short),
            4 => spring_ring(&mut rng, short),
            _ => capture(&mut rng, short),
        }
    }

    /// Writes the necessary files into `folder`; returns the scenario argument of the command line.
    pub(super) fn arguments(&self, folder: &Path) -> Vec<String> {
        let scenario = match &self.source {
            Source::Text(text) => {
                let path = folder.join("scenario.toml");
                std::fs::write(&path, text).expect("the folder can be written");
                path
            }
            Source::Capture => root().join("scenarios/close.toml"),
        };
        let duration = format!("{} ms", self.duration_ms);
        vec![scenario.display().to_string(), "--duration".into(), duration]
    }

    /// Whether its participants can be saved.
    pub(super) fn can_be_saved(&self) -> bool {
        self.slots.iter().all(|slot| slot.role != Role::Unsaved)
    }
}

/// A scenario under construction.
struct CaseBuilder {
    text: String,
    slots: Vec<Slot>,
    duration_ms: u64,
    short: bool,
}

impl CaseBuilder {
    fn new(rng: &mut Rng, short: bool) -> CaseBuilder {
        let duration_ms = if short { rng.between(10, 40) } else { 5000 };
        CaseBuilder {
            text: format!("duration = \"10 s\"\nseed = {}\n", rng.between(1, 1000)),
            slots: Vec::new(),
            duration_ms,
            short,
        }
    }

    fn push_line(&mut self, text: impl std::fmt::Display) {
        writeln!(self.text, "{text}").expect("a string takes everything");
    }

    fn add_participant(&mut self, name: &str, role: Role, exe: &Path, period: &str, more: &str) {
        self.slots.push(Slot {
            name: name.to_owned(),
            role,
        });
        let exe = exe.display();
        self.push_line(format_args!(
            "\n[participants.{name}]\nrun = {{ exe = \"{exe}\" }}\nperiod = \"{period}\"\n{more}"
        ));
    }

    fn add_oscillator(&mut self, name: &str) {
        self.add_participant(name, Role::Stateful, &participant("oscillator"), "1 ms", "");
    }

    fn add_damper(&mut self, rng: &mut Rng, name: &str) {
        let period = rng.choose(&["10 ms", "10 ms", "5 ms", "1/90 s"]);
        self.add_participant(name, Role::Damper, &participant("damper"), period, "");
    }

    /// A connection with random delay, jitter, drops and start value.
    fn add_connection(&mut self, rng: &mut Rng, name: &str, from: &str, to: &str) {
        self.push_line(format_args!("\n[connections.{name}]\nfrom = \"{from}\"\nto = \"{to}\""));
        let delay = rng.choose(&["0 ms", "0 ms", "3 ms", "1/300 s", "20 ms"]);
        self.push_line(format_args!("delay = \"{delay}\""));
        if rng.one_in(4) {
            self.push_line("jitter = \"5 ms\"");
        }
        if rng.one_in(5) {
            let hold = rng.choose(&["last", "initial"]);
            self.push_line(format_args!("drop = 0.05\nhold = \"{hold}\""));
        }
    }

    /// Signal faults, link faults, a guard that is never violated, and substitutions that keep the state.
    fn add_faults(&mut self, rng: &mut Rng, damper: &str, plant: &str) {
        if self.short {
            return;
        }
        if rng.one_in(2) {
            let (at, until) = (rng.below(2000), rng.between(2500, 4500));
            let kind = rng.choose(&[
                "field = \"velocity\"\nkind = \"bias\"\nvalue = \"0.1 m/s\"",
                "field = \"velocity\"\nkind = \"noise\"\nvalue = \"0.01 m/s\"",
                "kind = \"stuck\"",
                "kind = \"dropout\"\nprobability = 0.2",
            ]);
            let port = rng.choose(&["input", "output"]);
            let port = match port {
                "input" => format!("input = \"{damper}.motion\""),
                _ => format!("output = \"{plant}.motion\""),
            };
            self.push_line(format_args!(
                "\n[[faults]]\nname = \"sensor\"\nat = \"{at} ms\"\nuntil = \"{until} ms\"\n{port}\n{kind}"
            ));
        }
        if rng.one_in(3) {
            let at = rng.below(4000);
            self.push_line(format_args!(
                "\n[[faults]]\nname = \"link\"\nat = \"{at} ms\"\nconnection = \"push\"\ndrop = 0.2\nextra-delay = \"20 ms\""
            ));
        }
        if rng.one_in(2) {
            self.push_line(format_args!(
                "\n[guards.finite]\noutput = \"{plant}.motion\"\nfield = \"position\"\nrange = \"[-1e9, 1e9] m\""
            ));
        }
        for _ in 0..rng.below(3) {
            let (at, exe) = (rng.below(5000), participant("damper"));
            self.push_line(format_args!(
                "\n[[faults]]\nat = \"{at} ms\"\nsubstitute = \"{damper}\"\nrun = {{ exe = \"{}\" }}\nstate = \"keep\"",
                exe.display()
            ));
        }
    }

    fn build(self) -> Case {
        Case {
            slots: self.slots,
            duration_ms: self.duration_ms,
            code: 0,
            source: Source::Text(self.text),
        }
    }
}

/// `count` oscillators with a damper each, in a ring: a damper reads its own oscillator and pushes the next one.
fn oscillator_ring(rng: &mut Rng, count: u64, short: bool) -> Case {
    let mut builder = CaseBuilder::new(rng, short);
    let number = |name: &str, at: u64| match at {
        0 => name.to_owned(),
        _ => format!("{name}-{at}"),
    };
    for at in 0..count {
        builder.add_oscillator(&number("plant", at));
        builder.add_damper(rng, &number("damper", at));
    }
    for at in 0..count {
        let (plant, damper) = (number("plant", at), number("damper", at));
        let next = number("plant", (at + 1) % count);
        let motion = (format!("{plant}.motion"), format!("{damper}.motion"));
        builder.add_connection(rng, &number("motion", at), &motion.0, &motion.1);
        builder.add_connection(
            rng,
            &number("push", at),
            &format!("{damper}.push"),
            &format!("{next}.push"),
        );
    }
    builder.add_faults(rng, "damper", "plant");
    builder.build()
}

/// One oscillator that several dampers read and one of them pushes; the output of the others is only recorded.
fn one_to_many(rng: &mut Rng, short: bool) -> Case {
    let mut builder = CaseBuilder::new(rng, short);
    builder.add_oscillator("plant");
    let mut readers = Vec::new();
    for at in 0..rng.between(2, 4) {
        let name = if at == 0 {
            "damper".to_owned()
        } else {
            format!("damper-{at}")
        };
        builder.add_damper(rng, &name);
        readers.push(format!("{name}.motion"));
    }
    // A list of readers in one connection, which creates one link for each.
    builder.push_line(format_args!(
        "\n[connections.motion]\nfrom = \"plant.motion\"\nto = {readers:?}\njitter = \"2 ms\"\ninitial = \"first-sample\""
    ));
    builder.add_connection(rng, "push", "damper.push", "plant.push");
    builder.add_faults(rng, "damper", "plant");
    builder.build()
}

/// A ring of springs, each pulled by the one before it: the program of `examples/spring`.
fn spring_ring(rng: &mut Rng, short: bool) -> Case {
    let mut builder = CaseBuilder::new(rng, short);
    let count = rng.between(2, 5);
    for at in 0..count {
        let period = rng.choose(&["1 ms", "2 ms", "1/300 s"]);
        let parameters = format!("parameters = {{ position = 0.{} }}", at + 1);
        builder.add_participant(&format!("spring-{at}"), Role::Unsaved, &spring(), period, &parameters);
    }
    for at in 0..count {
        let (from, to) = (at, (at + 1) % count);
        builder.add_connection(
            rng,
            &format!("pull-{at}"),
            &format!("spring-{from}.motion"),
            &format!("spring-{to}.neighbour"),
        );
    }
    builder.build()
}

/// The stock close capture, which ends long before the grasp: complete, and not captured.
fn capture(rng: &mut Rng, short: bool) -> Case {
    let slots = ["plant", "controller", "guidance"].map(|name| Slot {
        name: name.to_owned(),
        role: Role::Stateful,
    });
    Case {
        slots: slots.to_vec(),
        duration_ms: if short {
            rng.between(10, 40)
        } else {
            rng.between(800, 2000)
        },
        code: 3,
        source: Source::Capture,
    }
}
