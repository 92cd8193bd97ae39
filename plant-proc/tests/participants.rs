//! Guarantees of every stock participant: no allocation in a step, and a complete saved state.

mod common;

use common::{load, make};
use interfaces::{CameraPose, Command, Housekeeping, Measured, SetPoint, TargetState, Truth};
use lockstep::participant::{Inputs, Outputs, Participant, Setup, Step};
use testing::allocation::{Counting, allocations_during};
use toml::Table;

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A participant with its ports.
struct WiredParticipant {
    setup: Setup,
    participant: Box<dyn Participant>,
    inputs: Inputs,
    outputs: Outputs,
    steps: u64,
}

impl WiredParticipant {
    fn new(scenario: &Table, name: &str) -> WiredParticipant {
        let (setup, mut participant) = make(scenario, name);
        let interface = participant.interface();
        let mut outputs = Outputs::zeroed(&interface);
        participant.initialise(0.0, &mut outputs).unwrap();
        WiredParticipant {
            setup,
            participant,
            inputs: Inputs::zeroed(&interface),
            outputs,
            steps: 0,
        }
    }

    fn step(&mut self) {
        let (k, period) = (self.steps, self.setup.period);
        let step = Step {
            index: k,
            t: k as f64 * period,
            t_next: (k + 1) as f64 * period,
            period,
        };
        self.participant.step(&step, &self.inputs, &mut self.outputs).unwrap();
        self.steps += 1;
    }
}

/// Plant, guidance and controller wired by hand, without delays.
struct WiredLoop {
    plant: WiredParticipant,
    guidance: WiredParticipant,
    controller: WiredParticipant,
}

/// A participant at an instant.
struct SavedParticipant {
    state: Vec<u8>,
    steps: u64,
    outputs: Vec<Vec<u8>>,
}

impl WiredLoop {
    fn new(name: &str) -> WiredLoop {
        WiredLoop::with(name, |_| {})
    }

    /// With other parameters of the plant.
    fn with(name: &str, change: impl Fn(&mut Table)) -> WiredLoop {
        let (name, spherical) = name.split_once('+').map_or((name, false), |(name, _)| (name, true));
        let mut scenario = load(name);
        let plant = scenario["participants"]["plant"]["parameters"].as_table_mut().unwrap();
        if spherical {
            plant.insert("slosh".into(), "spherical".into());
        }
        change(plant);
        // early, so that it falls within a short run
        if let Some(after) = scenario["participants"]["plant"]["parameters"].get_mut("after_grasp") {
            after["at"] = "0.15 s".into();
            after["within"] = "10 m".into();
            after["within_angle"] = "180 deg".into();
        }
        WiredLoop {
            plant: WiredParticipant::new(&scenario, "plant"),
            guidance: WiredParticipant::new(&scenario, "guidance"),
            controller: WiredParticipant::new(&scenario, "controller"),
        }
    }

    /// Ten milliseconds.
    fn advance(&mut self) {
        let (plant, guidance, controller) = (&mut self.plant, &mut self.guidance, &mut self.controller);
        *guidance.inputs.get_mut::<Measured>(0) = *plant.outputs.get(0);
        *guidance.inputs.get_mut::<TargetState>(1) = *plant.outputs.get(1);
        *guidance.inputs.get_mut::<CameraPose>(2) = *plant.outputs.get(2);
        guidance.step();
        *controller.inputs.get_mut::<Measured>(0) = *plant.outputs.get(0);
        *controller.inputs.get_mut::<SetPoint>(1) = *guidance.outputs.get(0);
        *controller.inputs.get_mut::<SetPoint>(2) = *guidance.outputs.get(1);
        *controller.inputs.get_mut::<Housekeeping>(3) = *plant.outputs.get(3);
        controller.step();
        *plant.inputs.get_mut::<Command>(0) = *controller.outputs.get(0);
        for _ in 0..10 {
            plant.step();
        }
    }

    fn participants(&mut self) -> [&mut WiredParticipant; 3] {
        [&mut self.plant, &mut self.guidance, &mut self.controller]
    }

    /// State, steps and outputs of each participant.
    fn save(&mut self) -> Vec<SavedParticipant> {
        let save = |one: &mut WiredParticipant| {
            let ports = one.participant.interface().outputs.len();
            SavedParticipant {
                state: one.participant.save().unwrap(),
                steps: one.steps,
                outputs: (0..ports).map(|port| one.outputs.bytes_mut(port).to_vec()).collect(),
            }
        };
        self.participants().map(save).into()
    }

    fn restore(&mut self, saved: &[SavedParticipant]) {
        for (one, saved) in self.participants().into_iter().zip(saved) {
            one.participant.restore(&saved.state).unwrap();
            one.steps = saved.steps;
            for (port, bytes) in saved.outputs.iter().enumerate() {
                one.outputs.bytes_mut(port).copy_from_slice(bytes);
            }
        }
    }

    /// All outputs as bits.
    fn outputs(&mut self) -> Vec<u8> {
        let mut all = Vec::new();
        for one in self.participants() {
            let ports = one.participant.interface().outputs.len();
            (0..ports).for_each(|port| all.extend_from_slice(one.outputs.bytes_mut(port)));
        }
        all
    }
}

#[test]
fn no_step_allocates() {
    for name in ["close", "realistic", "reference-close", "capture-and-stabilise"] {
        let mut wired = WiredLoop::new(name);
        wired.advance();
        let allocations = allocations_during(|| (0..40).for_each(|_| wired.advance()));
        assert_eq!(allocations.count, 0, "{name}");
    }
}

#[test]
fn restored_participant_continues_bit_for_bit() {
    for name in [
        "close",
        "realistic",
        "reference-close",
        "capture-and-stabilise",
        "capture-and-stabilise+spherical",
    ] {
        let mut original = WiredLoop::new(name);
        (0..23).for_each(|_| original.advance());
        let mut restored = WiredLoop::new(name);
        restored.restore(&original.save());
        for _ in 0..23 {
            original.advance();
            restored.advance();
            assert!(original.outputs() == restored.outputs(), "{name}");
        }
    }
}

/// A run goes back to a checkpoint in place, over the grasp too, and forward again.
#[test]
fn state_is_restored_in_place_on_both_sides_of_the_grasp() {
    for name in ["capture-and-stabilise", "capture-and-stabilise+spherical"] {
        let mut wired = WiredLoop::new(name);
        let mut states = Vec::new();
        let mut outputs = Vec::new();
        for _ in 0..30 {
            states.push(wired.save());
            wired.advance();
            outputs.push(wired.outputs());
        }
        let grasped = |wired: &WiredLoop| wired.plant.outputs.get::<Truth>(4).grasped;
        assert!(grasped(&wired), "{name}");
        // after it, before it, after it again, and twice the same side
        for from in [20, 5, 25, 10, 3, 18] {
            wired.restore(&states[from]);
            assert_eq!(grasped(&wired), from > 15, "{name} {from}");
            for expected in &outputs[from..] {
                wired.advance();
                assert!(wired.outputs() == *expected, "{name}, from {from}");
            }
        }
    }
}

#[test]
fn state_of_the_other_pendulum_is_refused() {
    let (mut hinges, mut spherical) = (WiredLoop::new("close"), WiredLoop::new("close+spherical"));
    let states = [&mut hinges, &mut spherical].map(|wired| wired.plant.participant.save().unwrap());
    for (wired, state) in [(&mut hinges, &states[1]), (&mut spherical, &states[0])] {
        let before = wired.plant.participant.save();
        let reason = wired.plant.participant.restore(state).unwrap_err().to_string();
        assert!(
            reason.contains("slosh = \"hinges\"") || reason.contains("slosh = \"spherical\""),
            "{reason}"
        );
        assert_eq!(wired.plant.participant.save(), before, "nothing is changed");
    }
}

/// What other masses add to momentum and energy is no residual of the simulation.
#[test]
fn ledger_of_a_branch_with_other_masses_closes() {
    for steps in [10, 23] {
        let mut original = WiredLoop::new("capture-and-stabilise");
        (0..steps).for_each(|_| original.advance());
        let mut branch = WiredLoop::with("capture-and-stabilise", |plant| {
            plant["target"]["mass"] = "900 kg".into();
            plant["target"]["inertia"] = "[60, 60, 50] kg m^2".into();
        });
        branch.restore(&original.save());
        let residuals = |wired: &WiredLoop| {
            let truth = wired.plant.outputs.get::<Truth>(4);
            let largest = |values: &[f64]| values.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
            let momenta = largest(&truth.linear_residual_N).max(largest(&truth.angular_residual_N));
            momenta.max(truth.energy_residual.abs())
        };
        (0..15).for_each(|_| branch.advance());
        assert!(residuals(&branch) < 1e-9, "{steps}: {}", residuals(&branch));
    }
}

#[test]
fn participant_rejects_malformed_state() {
    let mut wired = WiredLoop::new("close");
    for one in wired.participants() {
        let state = one.participant.save().unwrap();
        for bad in [&state[..state.len() - 1], &[], &[7; 40]] {
            assert!(one.participant.restore(bad).is_err(), "{}", one.setup.name);
        }
    }
}
