//! The scenarios of the long tests, drawn at random.

use std::fmt::Write as _;
use std::path::Path;

use super::Dice;
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
pub(super) struct Seat {
    pub(super) name: String,
    pub(super) role: Role,
}

/// A scenario.
#[derive(Debug, Clone)]
pub(super) struct Case {
    pub(super) seats: Vec<Seat>,
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
    pub(super) fn draw(seed: u64, number: u64, short: bool) -> Case {
        let mut dice = Dice::new(seed, &format!("case {number}"));
        // Every kind occurs in any six consecutive cases.
        match number % 6 {
            0 | 3 => pairs(&mut dice, 1, short),
            1 => {
                let count = dice.between(2, 3);
                pairs(&mut dice, count, short)
            }
            2 => fan(&mut dice, short),
            4 => springs(&mut dice, short),
            _ => capture(&mut dice, short),
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
    pub(super) fn saved(&self) -> bool {
        self.seats.iter().all(|seat| seat.role != Role::Unsaved)
    }
}

/// A scenario under construction.
struct Draft {
    text: String,
    seats: Vec<Seat>,
    duration_ms: u64,
    short: bool,
}

impl Draft {
    fn new(dice: &mut Dice, short: bool) -> Draft {
        let duration_ms = if short { dice.between(10, 40) } else { 5000 };
        Draft {
            text: format!("duration = \"10 s\"\nseed = {}\n", dice.between(1, 1000)),
            seats: Vec::new(),
            duration_ms,
            short,
        }
    }

    fn add(&mut self, text: impl std::fmt::Display) {
        writeln!(self.text, "{text}").expect("a string takes everything");
    }

    fn seat(&mut self, name: &str, role: Role, exe: &Path, period: &str, more: &str) {
        self.seats.push(Seat {
            name: name.to_owned(),
            role,
        });
        let exe = exe.display();
        self.add(format_args!(
            "\n[participants.{name}]\nrun = {{ exe = \"{exe}\" }}\nperiod = \"{period}\"\n{more}"
        ));
    }

    fn oscillator(&mut self, name: &str) {
        self.seat(name, Role::Stateful, &participant("oscillator"), "1 ms", "");
    }

    fn damper(&mut self, dice: &mut Dice, name: &str) {
        let period = dice.pick(&["10 ms", "10 ms", "5 ms", "1/90 s"]);
        self.seat(name, Role::Damper, &participant("damper"), period, "");
    }

    /// A connection with random delay, jitter, drops and start value.
    fn link(&mut self, dice: &mut Dice, name: &str, from: &str, to: &str) {
        self.add(format_args!("\n[connections.{name}]\nfrom = \"{from}\"\nto = \"{to}\""));
        let delay = dice.pick(&["0 ms", "0 ms", "3 ms", "1/300 s", "20 ms"]);
        self.add(format_args!("delay = \"{delay}\""));
        if dice.one_in(4) {
            self.add("jitter = \"5 ms\"");
        }
        if dice.one_in(5) {
            let hold = dice.pick(&["last", "initial"]);
            self.add(format_args!("drop = 0.05\nhold = \"{hold}\""));
        }
    }

    /// Signal faults, link faults, a guard that is never violated, and substitutions that keep the state.
    fn trouble(&mut self, dice: &mut Dice, damper: &str, plant: &str) {
        if self.short {
            return;
        }
        if dice.one_in(2) {
            let (at, until) = (dice.below(2000), dice.between(2500, 4500));
            let kind = dice.pick(&[
                "field = \"velocity\"\nkind = \"bias\"\nvalue = \"0.1 m/s\"",
                "field = \"velocity\"\nkind = \"noise\"\nvalue = \"0.01 m/s\"",
                "kind = \"stuck\"",
                "kind = \"dropout\"\nprobability = 0.2",
            ]);
            let port = dice.pick(&["input", "output"]);
            let port = match port {
                "input" => format!("input = \"{damper}.motion\""),
                _ => format!("output = \"{plant}.motion\""),
            };
            self.add(format_args!(
                "\n[[faults]]\nname = \"sensor\"\nat = \"{at} ms\"\nuntil = \"{until} ms\"\n{port}\n{kind}"
            ));
        }
        if dice.one_in(3) {
            let at = dice.below(4000);
            self.add(format_args!(
                "\n[[faults]]\nname = \"link\"\nat = \"{at} ms\"\nconnection = \"push\"\ndrop = 0.2\nextra-delay = \"20 ms\""
            ));
        }
        if dice.one_in(2) {
            self.add(format_args!(
                "\n[guards.finite]\noutput = \"{plant}.motion\"\nfield = \"position\"\nrange = \"[-1e9, 1e9] m\""
            ));
        }
        for _ in 0..dice.below(3) {
            let (at, exe) = (dice.below(5000), participant("damper"));
            self.add(format_args!(
                "\n[[faults]]\nat = \"{at} ms\"\nsubstitute = \"{damper}\"\nrun = {{ exe = \"{}\" }}\nstate = \"keep\"",
                exe.display()
            ));
        }
    }

    fn done(self) -> Case {
        Case {
            seats: self.seats,
            duration_ms: self.duration_ms,
            code: 0,
            source: Source::Text(self.text),
        }
    }
}

/// `count` oscillators with a damper each, in a ring: a damper reads its own oscillator and pushes the next one.
fn pairs(dice: &mut Dice, count: u64, short: bool) -> Case {
    let mut draft = Draft::new(dice, short);
    let number = |name: &str, at: u64| match at {
        0 => name.to_owned(),
        _ => format!("{name}-{at}"),
    };
    for at in 0..count {
        draft.oscillator(&number("plant", at));
        draft.damper(dice, &number("damper", at));
    }
    for at in 0..count {
        let (plant, damper) = (number("plant", at), number("damper", at));
        let next = number("plant", (at + 1) % count);
        let motion = (format!("{plant}.motion"), format!("{damper}.motion"));
        draft.link(dice, &number("motion", at), &motion.0, &motion.1);
        draft.link(
            dice,
            &number("push", at),
            &format!("{damper}.push"),
            &format!("{next}.push"),
        );
    }
    draft.trouble(dice, "damper", "plant");
    draft.done()
}

/// One oscillator that several dampers read and one of them pushes; the output of the others is only recorded.
fn fan(dice: &mut Dice, short: bool) -> Case {
    let mut draft = Draft::new(dice, short);
    draft.oscillator("plant");
    let mut readers = Vec::new();
    for at in 0..dice.between(2, 4) {
        let name = if at == 0 {
            "damper".to_owned()
        } else {
            format!("damper-{at}")
        };
        draft.damper(dice, &name);
        readers.push(format!("{name}.motion"));
    }
    // A list of readers in one connection, which creates one link for each.
    draft.add(format_args!(
        "\n[connections.motion]\nfrom = \"plant.motion\"\nto = {readers:?}\njitter = \"2 ms\"\ninitial = \"first-sample\""
    ));
    draft.link(dice, "push", "damper.push", "plant.push");
    draft.trouble(dice, "damper", "plant");
    draft.done()
}

/// A ring of springs, each pulled by the one before it: the program of `examples/spring`.
fn springs(dice: &mut Dice, short: bool) -> Case {
    let mut draft = Draft::new(dice, short);
    let count = dice.between(2, 5);
    for at in 0..count {
        let period = dice.pick(&["1 ms", "2 ms", "1/300 s"]);
        let parameters = format!("parameters = {{ position = 0.{} }}", at + 1);
        draft.seat(&format!("spring-{at}"), Role::Unsaved, &spring(), period, &parameters);
    }
    for at in 0..count {
        let (from, to) = (at, (at + 1) % count);
        draft.link(
            dice,
            &format!("pull-{at}"),
            &format!("spring-{from}.motion"),
            &format!("spring-{to}.neighbour"),
        );
    }
    draft.done()
}

/// The stock close capture, which ends long before the grasp: complete, and not captured.
fn capture(dice: &mut Dice, short: bool) -> Case {
    let seats = ["plant", "controller", "guidance"].map(|name| Seat {
        name: name.to_owned(),
        role: Role::Stateful,
    });
    Case {
        seats: seats.to_vec(),
        duration_ms: if short {
            dice.between(10, 40)
        } else {
            dice.between(800, 2000)
        },
        code: 3,
        source: Source::Capture,
    }
}
