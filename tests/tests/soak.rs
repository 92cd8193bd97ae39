//! Rounds of disorder: participants and the orchestrator are killed, stopped, terminated and substituted at random times, runs
//! are saved and resumed. After each round: the exit code, no process, nothing in shared memory, and a tape that is a prefix
//! of the undisturbed one, or equal to it where that was promised.
//!
//! `ESCAPEMENT_SOAK_ROUNDS` and `ESCAPEMENT_SOAK_SEED` set how many rounds there are and where they begin; each round prints
//! its seed, and is the same again when it is given as the first one (as far as the machine's time lets it be).

use std::path::Path;
use std::time::Duration;

use escapement_tests::machine::{leftovers, processes_of, signal, wait_for, writer_of};
use escapement_tests::program::{Folder, finish, orchestrate, participant, start, text};
use escapement_tests::world::{oscillator, prefix};
use lockstep::random::Stream;
use rustix::process::Signal;

const ROUNDS: u64 = 120;
/// Samples of the shortest stream of a whole run.
const WHOLE: u64 = 1000;

fn setting(name: &str, default: u64) -> u64 {
    std::env::var(name)
        .ok()
        .map_or(default, |text| text.parse().expect("a setting is a number"))
}

/// The draws of one round.
struct Dice(Stream, u64);

impl Dice {
    fn roll(&mut self, sides: u64) -> u64 {
        self.1 += 1;
        self.0.bits(self.1) % sides
    }

    fn pick<T: Copy>(&mut self, of: &[T]) -> T {
        of[self.roll(of.len() as u64) as usize]
    }
}

#[test]
fn whatever_happens_nothing_is_lost_and_nothing_is_left() {
    let home = Folder::new("soak");
    let scenario = oscillator(&home, "damper");
    let undisturbed = home.path().join("undisturbed");
    let said = orchestrate(&["run", text(&scenario), "--out", text(&undisturbed), "--quiet"]);
    assert_eq!(said.code, Some(0), "{said:?}");
    let first = setting("ESCAPEMENT_SOAK_SEED", 1);
    for seed in first..first + setting("ESCAPEMENT_SOAK_ROUNDS", ROUNDS) {
        // Shown when the test fails.
        println!("round with seed {seed}");
        round(seed, &undisturbed);
    }
    assert_eq!(leftovers(), Vec::<String>::new());
}

fn round(seed: u64, undisturbed: &Path) {
    let mut dice = Dice(Stream::new(seed, "soak"), 0);
    let folder = Folder::new("round");
    let scenario = oscillator(&folder, "damper");
    let mut toml = std::fs::read_to_string(&scenario).expect("the scenario is there");
    let substitutions = dice.roll(3);
    for _ in 0..substitutions {
        let (at, exe) = (dice.roll(10_000), participant("damper"));
        toml += &format!(
            "\n[[faults]]\nat = \"{at} ms\"\nsubstitute = \"damper\"\nrun = {{ exe = \"{}\" }}\nstate = \"keep\"\n",
            exe.display()
        );
    }
    std::fs::write(&scenario, toml).expect("the folder can be written");
    let out = folder.path().join("run");
    let mut arguments = vec![
        "run",
        text(&scenario),
        "--out",
        text(&out),
        "--real-time=25",
        "--patience",
        "2 s",
    ];
    let restarts = dice.roll(3) > 0;
    if restarts {
        for who in ["plant", "damper"] {
            arguments.extend([
                "--set",
                match who {
                    "plant" => "participants.plant.on-failure=restart-from-checkpoint",
                    _ => "participants.damper.on-failure=restart-from-checkpoint",
                },
            ]);
        }
    }
    let every = dice.pick(&["", "700 ms", "1/3 s", "2 s"]);
    if !every.is_empty() {
        arguments.extend(["--checkpoint-every", every]);
    }
    let run = start(&arguments);
    wait_for(&out.join("tape/index.json"));
    let orchestrator = run.id();
    let mut beheaded = false;
    for _ in 0..dice.roll(3) {
        std::thread::sleep(Duration::from_micros(dice.roll(200_000)));
        let what = dice.pick(&[Signal::KILL, Signal::KILL, Signal::TERM, Signal::STOP]);
        match dice.roll(8) {
            0 => beheaded |= signal(orchestrator, Signal::KILL),
            1 => drop(signal(orchestrator, dice.pick(&[Signal::TERM, Signal::INT]))),
            number => {
                let who = ["plant", "damper"][number as usize % 2];
                // It may be gone already, or in the middle of a restart under another name.
                if let Some(pid) = writer_of(&out.join("log").join(format!("{who}.stderr"))) {
                    signal(pid, what);
                }
            }
        }
    }
    let said = finish(run);
    if beheaded {
        assert_eq!(orchestrate(&["doctor", "--remove"]).code, Some(0));
    }
    // What a killed orchestrator leaves behind is killed by the kernel, which takes its own time.
    let gone = || processes_of(folder.path()).is_empty();
    let looks = (0..2000)
        .take_while(|_| !gone())
        .map(|_| std::thread::sleep(Duration::from_millis(5)));
    looks.for_each(drop);
    assert_eq!(
        processes_of(folder.path()),
        Vec::<String>::new(),
        "seed {seed}: processes are left: {said:?}"
    );
    let samples = prefix(undisturbed, &out);
    match said.code {
        Some(0) => assert_eq!(samples, WHOLE, "seed {seed}: {said:?}"),
        Some(1) => assert!(!said.err.is_empty(), "seed {seed}: {said:?}"),
        None => assert!(beheaded, "seed {seed}: {said:?}"),
        Some(_) => panic!("seed {seed}: {said:?}"),
    }
    // Whatever was saved can be gone on with, and is the same run then.
    if std::fs::read_dir(out.join("checkpoints")).is_ok_and(|mut files| files.next().is_some()) {
        let again = folder.path().join("again");
        let how: &[&str] = if substitutions == 0 { &[] } else { &["--quiet"] };
        let mut arguments = vec!["resume", text(&out), "--out", text(&again)];
        arguments.extend(how);
        let said = orchestrate(&arguments);
        assert_eq!(said.code, Some(0), "seed {seed}: {said:?}");
        assert_eq!(prefix(undisturbed, &again), WHOLE, "seed {seed}");
    }
}
