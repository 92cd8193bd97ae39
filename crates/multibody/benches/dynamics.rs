//! Times the algorithms on the stock servicer: one JSON line per algorithm with the thread CPU time (ns per call) of
//! every round. `compare.sh` beside this file runs it alternately with Pinocchio and prints the ratios.
//!
//! usage: `dynamics STATES.txt [ROUNDS]`, or `dynamics --count ALGORITHM` to run one algorithm once over the states inside
//! [`counted`], for `instructions.sh`. STATES.txt has one state a line: quaternion wxyz, p, joint positions,
//! generalised velocity, generalised force. Without arguments (as `cargo bench` calls it) states are drawn here.

use multibody::{Description, ForLanes, Lanes, Method, Quaternion, State, Tree, lanes_max, with_lanes};
use nalgebra::SVector;
use std::hint::black_box;

type Servicer = Tree<9, 15>;
type Vector = SVector<f64, 15>;

struct Case {
    state: State<9, 15>,
    tau: Vector,
    acceleration: Vector,
}

fn main() {
    let mut args = std::env::args().skip(1).filter(|a| a != "--bench");
    let first = args.next();
    let mode = match first.as_deref() {
        Some("--count") => Mode::Count(args.next().expect("the name of an algorithm")),
        _ => Mode::Time(args.next().map_or(201, |r| r.parse().expect("ROUNDS is a number"))),
    };
    let text = match (&mode, first) {
        (Mode::Time(_), Some(path)) => std::fs::read_to_string(&path).expect("the file of states can be read"),
        _ => random_states(),
    };
    let description = Description::from_urdf(include_str!("../../../models/servicer.urdf")).expect("a valid model");
    let tree = Servicer::new(&description).expect("a valid tree");
    let cases: Vec<Case> = text.lines().map(|l| case(&tree, l)).collect();
    run(&tree, &cases, &mode);
}

enum Mode {
    /// Number of rounds of each algorithm.
    Time(usize),
    /// One pass of this algorithm.
    Count(String),
}

/// The region that callgrind counts: it starts and stops at this function.
#[inline(never)]
fn counted(calls: usize, f: &dyn Fn(usize)) {
    (0..calls).for_each(f);
}

fn run(tree: &Servicer, cases: &[Case], mode: &Mode) {
    let frame = tree.frame("end_effector").expect("the model has it");
    let n = cases.len();
    let time = |name: &str, per_call: usize, f: &dyn Fn(usize)| match mode {
        Mode::Time(rounds) => measure(name, n / per_call, per_call, *rounds, f),
        Mode::Count(wanted) if wanted == name => counted(n / per_call, f),
        Mode::Count(_) => {}
    };

    time("aba", 1, &|i| {
        let c = &cases[i];
        black_box(tree.aba(black_box(&c.state.q), black_box(&c.state.nu), black_box(&c.tau)));
    });
    time("rnea", 1, &|i| {
        let c = &cases[i];
        black_box(tree.rnea(
            black_box(&c.state.q),
            black_box(&c.state.nu),
            black_box(&c.acceleration),
        ));
    });
    time("crba", 1, &|i| {
        black_box(tree.mass_matrix(black_box(&cases[i].state.q)));
    });
    time("M+C+J", 1, &|i| {
        let s = &cases[i].state;
        let k = tree.kinematics(black_box(&s.q), black_box(&s.nu));
        black_box(tree.mass_and_coriolis(&k));
        black_box(tree.jacobian(&k, frame));
    });
    time("M a + C nu_r", 1, &|i| {
        let c = &cases[i];
        let (q, nu) = (black_box(&c.state.q), black_box(&c.state.nu));
        black_box(tree.mass_coriolis_product(q, nu, black_box(&c.acceleration), black_box(&c.tau)));
    });
    time("rk4 step", 1, &|i| {
        let c = &cases[i];
        black_box(tree.step(Method::Rk4, black_box(&c.state), black_box(&c.tau), black_box(1e-3)));
    });
    for lanes in [4, 8] {
        if lanes <= lanes_max() {
            with_lanes(
                lanes,
                AbaInLanes {
                    tree,
                    cases,
                    time: &time,
                },
            );
        }
    }
}

/// Takes a name, the number of states of a call, and the call.
type Measure<'a> = dyn Fn(&str, usize, &dyn Fn(usize)) + 'a;

/// Forward dynamics in lanes.
struct AbaInLanes<'a> {
    tree: &'a Servicer,
    cases: &'a [Case],
    time: &'a Measure<'a>,
}

impl ForLanes for AbaInLanes<'_> {
    type Output = ();

    fn run<T: Lanes>(self) {
        let groups: Vec<_> = self.cases.chunks_exact(T::WIDTH).map(in_lanes::<T>).collect();
        (self.time)(&format!("aba, {} lanes", T::WIDTH), T::WIDTH, &|i| {
            let (q, nu, tau) = &groups[i];
            black_box(self.tree.aba_in_lanes(black_box(q), black_box(nu), black_box(tau)));
        });
    }
}

fn in_lanes<T: Lanes>(cases: &[Case]) -> ([T; 9], [T; 15], [T; 15]) {
    (
        std::array::from_fn(|i| T::gather(|lane| cases[lane].state.q[i])),
        std::array::from_fn(|i| T::gather(|lane| cases[lane].state.nu[i])),
        std::array::from_fn(|i| T::gather(|lane| cases[lane].tau[i])),
    )
}

/// Rounds of about 0.2 ms each, so that a shared machine disturbs only some of them.
fn measure(name: &str, calls: usize, per_call: usize, rounds: usize, f: &dyn Fn(usize)) {
    let pass = || (0..calls).for_each(f);
    (0..20).for_each(|_| pass());
    let start = thread_time_ns();
    pass();
    let repeat = ((2.0e5 / (thread_time_ns() - start).max(1.0)) as usize).max(1);
    let mut samples = Vec::with_capacity(rounds);
    for _ in 0..rounds {
        let start = thread_time_ns();
        (0..repeat).for_each(|_| pass());
        samples.push((thread_time_ns() - start) / (repeat * calls * per_call) as f64);
    }
    let list: Vec<String> = samples.iter().map(|s| format!("{s:.1}")).collect();
    println!("{{\"what\":\"{name}\",\"ns\":[{}]}}", list.join(","));
}

fn thread_time_ns() -> f64 {
    let t = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    1e9 * t.tv_sec as f64 + t.tv_nsec as f64
}

fn case(tree: &Servicer, line: &str) -> Case {
    let x: Vec<f64> = line.split_whitespace().map(|w| w.parse().expect("a number")).collect();
    assert_eq!(x.len(), 4 + 3 + 9 + 15 + 15, "numbers on a line of the file of states");
    let state = State {
        quat_nb: Quaternion::from_wxyz([x[0], x[1], x[2], x[3]]),
        p_nb: nalgebra::Vector3::new(x[4], x[5], x[6]),
        q: SVector::from_column_slice(&x[7..16]),
        nu: SVector::from_column_slice(&x[16..31]),
    };
    let tau = SVector::from_column_slice(&x[31..46]);
    Case {
        state,
        tau,
        acceleration: tree.aba(&state.q, &state.nu, &tau),
    }
}

/// 64 states from a small generator, used when no file is given.
fn random_states() -> String {
    let mut seed = 7_u64;
    let mut uniform = move || {
        seed = seed
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        2.0 * ((seed >> 11) as f64 / (1_u64 << 53) as f64) - 1.0
    };
    let mut lines = String::new();
    for _ in 0..64 {
        let quat = Quaternion {
            w: uniform(),
            x: uniform(),
            y: uniform(),
            z: uniform(),
        }
        .normalized();
        let mut x: Vec<f64> = quat.to_wxyz().to_vec();
        for (count, scale) in [(3, 2.0), (9, 2.5), (15, 1.0), (15, 5.0)] {
            x.extend((0..count).map(|_| scale * uniform()));
        }
        lines += &x.iter().map(|x| format!("{x:?}")).collect::<Vec<_>>().join(" ");
        lines.push('\n');
    }
    lines
}
