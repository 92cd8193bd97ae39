//! The joint angles that the stock guidance and controller command on their way to the grasp.
//!
//! Guidance and controller of the scenario are stepped with a servicer that follows every virtual velocity exactly. This
//! needs neither gains nor forces, so an unstable loop has a path as well, and it takes milliseconds.

use guidance_laws::TargetState as TargetMotion;
use guidance_laws::target::TargetModel;
use interfaces::files::Target;
use interfaces::{ControlTelemetry, Measured, SetPoint, TargetState, Truth};
use lockstep::participant::{Inputs, Outputs, ParameterError, Participant, Setup, Step};
use multibody::nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};
use toml::{Table, Value};

/// Time between two evaluations of both laws, s: the outer loop responds within a second, and joints turn by less than 0.2
/// deg in this time.
const STEP_S: f64 = 0.05;

/// A configuration on the path.
#[derive(Debug, Clone, PartialEq)]
pub struct Configuration {
    /// Its name on the path.
    pub name: &'static str,
    /// Joint angles, deg.
    pub joints_deg: Vec<f64>,
}

/// Creates a stock participant.
type Factory = fn(&Setup) -> Result<Box<dyn Participant>, ParameterError>;

/// A stock participant with its buffers.
struct BufferedParticipant {
    participant: Box<dyn Participant>,
    inputs: Inputs,
    outputs: Outputs,
    ports: [Vec<String>; 2],
}

impl BufferedParticipant {
    fn new(factory: Factory, setup: &Setup) -> Option<Self> {
        let participant = factory(setup).ok()?;
        let interface = participant.interface();
        Some(Self {
            inputs: Inputs::zeroed(&interface),
            outputs: Outputs::zeroed(&interface),
            ports: [
                interface.inputs.iter().map(|port| port.name.clone()).collect(),
                interface.outputs.iter().map(|port| port.name.clone()).collect(),
            ],
            participant,
        })
    }

    fn input(&self, name: &str) -> Option<usize> {
        self.ports[0].iter().position(|port| port == name)
    }

    fn output(&self, name: &str) -> Option<usize> {
        self.ports[1].iter().position(|port| port == name)
    }

    fn step(&mut self, index: u64) -> Option<()> {
        let t = index as f64 * STEP_S;
        let step = Step {
            index,
            t,
            t_next: t + STEP_S,
            period: STEP_S,
        };
        self.participant.step(&step, &self.inputs, &mut self.outputs).ok()
    }
}

/// The initial configuration of the plant.
pub(super) fn start(plant: &Setup) -> Option<Configuration> {
    let (truth, _) = start_state(plant)?;
    Some(configuration("start", &truth.q))
}

/// The configurations at the start, when the end effector points, and at the grasp. `None` when a participant rejects its
/// parameters, which the run itself reports.
pub(super) fn path(plant: &Setup, controller: &Setup, guidance: &Setup) -> Option<Vec<Configuration>> {
    let instants = [("pointing", "point"), ("grasp", "grasp")];
    let instants = instants.map(|(name, key)| Some((name, schedule_instant(guidance, key)?)));
    let (truth, mut target) = start_state(plant)?;
    let model = target_model(plant)?;
    let mut found = vec![configuration("start", &truth.q)];
    let mut controller = BufferedParticipant::new(controller_proc::factory, &with_exact_target(controller))?;
    let mut guidance = BufferedParticipant::new(guidance_proc::factory, &with_exact_target(guidance))?;
    let mut servicer = Measured {
        p_NB_N: truth.p_NB_N,
        quat_NB: truth.quat_NB,
        q: truth.q,
        ..Measured::default()
    };
    let mut index = 0;
    for (name, at) in instants.into_iter().flatten() {
        while (index as f64) * STEP_S < at - 0.5 * STEP_S {
            advance(&mut servicer, &target, &mut guidance, &mut controller, index)?;
            target = model.predicted(&target, STEP_S);
            index += 1;
        }
        found.push(configuration(name, &servicer.q));
    }
    Some(found)
}

/// Evaluates both laws, and moves the servicer accordingly.
fn advance(
    servicer: &mut Measured,
    target: &TargetMotion,
    guidance: &mut BufferedParticipant,
    controller: &mut BufferedParticipant,
    index: u64,
) -> Option<()> {
    let quaternion = target.pose.attitude.quaternion();
    let received = TargetState {
        stamp: index as f64 * STEP_S,
        p_NT_N: target.pose.position.into(),
        quat_NT: [quaternion.w, quaternion.i, quaternion.j, quaternion.k],
        v_NT_N: target.velocity.into(),
        omega_NT_T: target.rate.into(),
    };
    *guidance.inputs.get_mut::<Measured>(guidance.input("measured")?) = *servicer;
    *guidance.inputs.get_mut::<TargetState>(guidance.input("target")?) = received;
    guidance.step(index)?;
    for port in ["setpoint", "base_setpoint"] {
        let set_point = *guidance.outputs.get::<SetPoint>(guidance.output(port)?);
        *controller.inputs.get_mut::<SetPoint>(controller.input(port)?) = set_point;
    }
    *controller.inputs.get_mut::<Measured>(controller.input("measured")?) = *servicer;
    controller.step(index)?;
    let commanded = controller
        .outputs
        .get::<ControlTelemetry>(controller.output("telemetry")?);
    let attitude = unit(servicer.quat_NB);
    let turned = attitude * UnitQuaternion::from_scaled_axis(Vector3::from(commanded.omega_v_B) * STEP_S);
    let position = Vector3::from(servicer.p_NB_N) + attitude * Vector3::from(commanded.v_v_B) * STEP_S;
    servicer.p_NB_N = position.into();
    servicer.quat_NB = [turned.w, turned.i, turned.j, turned.k];
    servicer.omega_NB_B = commanded.omega_v_B;
    servicer.v_NB_B = commanded.v_v_B;
    for (joint, rate) in commanded.qdot_v.iter().enumerate() {
        servicer.q[joint] += rate * STEP_S;
        servicer.qdot[joint] = *rate;
    }
    Some(())
}

/// The same law, evaluated with an exact target every [`STEP_S`].
fn with_exact_target(setup: &Setup) -> Setup {
    let mut adapted = setup.clone();
    adapted.period = STEP_S;
    // A filter upstream of the guidance changes the time at which the target is known, not its motion.
    adapted.parameters.remove("navigation");
    adapted.parameters.remove("predict_target");
    adapted
}

fn start_state(plant: &Setup) -> Option<(Truth, TargetMotion)> {
    let mut plant = BufferedParticipant::new(plant_proc::factory, plant)?;
    plant.participant.initialise(0.0, &mut plant.outputs).ok()?;
    let truth = *plant.outputs.get::<Truth>(plant.output("truth")?);
    let target = TargetMotion::from_raw(truth.p_NT_N, truth.quat_NT, truth.v_NT_N, truth.omega_NT_T)?;
    Some((truth, target))
}

fn target_model(plant: &Setup) -> Option<TargetModel> {
    let table = plant.parameters.get("target").and_then(Value::as_table)?;
    let target: Target = lockstep::units::read(table).ok()?;
    TargetModel::new(Matrix3::from_diagonal(&Vector3::from(target.inertia.si())), STEP_S).ok()
}

fn schedule_instant(guidance: &Setup, key: &str) -> Option<f64> {
    let schedule = guidance.parameters.get("schedule").and_then(Value::as_table)?;
    time(schedule, key)
}

fn configuration(name: &'static str, joints_rad: &[f64]) -> Configuration {
    Configuration {
        name,
        joints_deg: joints_rad.iter().map(|q| q.to_degrees()).collect(),
    }
}

fn unit([w, i, j, k]: [f64; 4]) -> UnitQuaternion<f64> {
    UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k))
}

/// A time as written in a scenario, s.
pub(super) fn time(table: &Table, key: &str) -> Option<f64> {
    let text = table.get(key).and_then(Value::as_str)?;
    lockstep::units::convert(text, "s").ok()?.0.first().copied()
}
