//! Guarantees of every stock participant: no allocation in a step, and a complete saved state.

mod common;

use common::{load, make};
use interfaces::{CameraPose, Command, Housekeeping, Measured, SetPoint, TargetState};
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

impl WiredLoop {
    fn new(name: &str) -> WiredLoop {
        let (name, spherical) = name.split_once('+').map_or((name, false), |(name, _)| (name, true));
        let mut scenario = load(name);
        if spherical {
            let plant = scenario["participants"]["plant"]["parameters"].as_table_mut().unwrap();
            plant.insert("slosh".into(), "spherical".into());
        }
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
        for (from, to) in original.participants().into_iter().zip(restored.participants()) {
            let state = from.participant.save().unwrap();
            to.participant.restore(&state).unwrap();
            to.steps = from.steps;
            let ports = from.participant.interface().outputs.len();
            (0..ports).for_each(|port| to.outputs.bytes_mut(port).copy_from_slice(from.outputs.bytes_mut(port)));
        }
        for _ in 0..23 {
            original.advance();
            restored.advance();
            assert!(original.outputs() == restored.outputs(), "{name}");
        }
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
