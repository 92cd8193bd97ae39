//! Stability of the stock controller's sampled velocity loop with the robot and the delays of a scenario, at the
//! configurations on its path: start, pointing, grasp.
//!
//! The analysis applies only where the stock controller reads the stock plant and commands it. It does not include the
//! outer loop, the bound of the feedback and the actuators' limits.

mod path;

use interfaces::files::Servicer;
use lockstep::link::Timing;
use lockstep::participant::Setup;
use multibody::{Description, UrdfOptions};
use serde::Serialize;
use synthesis::linalg::{self, Matrix};
use synthesis::robot::{LoopTiming, ModelSpec, Robot, RobotError, RobotSpec, SampledLoop};
use toml::{Table, Value};

use engine::Finding;
use engine::scenario::{Entry, Program, Scenario};

pub use path::Configuration;
use path::time;

/// The stated margin: the loop stays stable with all gains multiplied by this factor …
pub const GAIN_MARGIN: f64 = 1.25;
/// … and, at its own gains, with commands delayed by this fraction of the controller's period.
pub const DELAY_MARGIN_PERIODS: f64 = 0.5;

/// The longest delay around the loop that is analysed, controller periods. Every period in transit adds the samples of all channels to the
/// states, and the eigenvalues take the cube of their number: beyond this the analysis would take seconds.
const DELAY_MAX_PERIODS: f64 = 30.0;

/// The loop of one controller.
#[derive(Debug, Clone, Serialize)]
pub struct VelocityLoop {
    /// The controller's name.
    pub controller: String,
    /// Age of the measurement it reads, s.
    pub measured_delay_s: f64,
    /// Delay until its command takes effect, s.
    pub command_delay_s: f64,
    /// The results of the analysis, along the path; none if the delay is too long for it.
    pub configurations: Vec<ConfigurationStability>,
}

/// One configuration.
#[derive(Debug, Clone, Serialize)]
pub struct ConfigurationStability {
    /// Its name on the path.
    pub name: &'static str,
    /// Joint angles, deg.
    pub joints_deg: Vec<f64>,
    /// Spectral radius over one controller period, propellant sloshing.
    pub spectral_radius: f64,
    /// The same with the gains of the stated margin.
    pub with_larger_gains: f64,
    /// The same with the delay of the stated margin.
    pub with_more_delay: f64,
}

impl ConfigurationStability {
    /// Whether the loop is stable.
    pub fn stable(&self) -> bool {
        SampledLoop::is_stable(self.spectral_radius)
    }

    /// Whether it is stable with the stated margin.
    pub fn with_margin(&self) -> bool {
        let radii = [self.spectral_radius, self.with_larger_gains, self.with_more_delay];
        radii.into_iter().all(SampledLoop::is_stable)
    }
}

/// The loops of a scenario's stock controllers. A loop whose parameters are rejected is left out: the run reports the
/// error.
pub fn loops(scenario: &Scenario) -> Vec<VelocityLoop> {
    let controllers = scenario
        .participants
        .iter()
        .filter(|entry| is_builtin(entry, "controller"));
    controllers.filter_map(|entry| analyse_loop(scenario, entry)).collect()
}

/// The loops as findings of `check`: the spectral radii, and whether the margin is met. There is one warning for each loop
/// that is unstable, or stable without the stated margin, about its worst configuration. No finding prevents a run.
pub fn findings(scenario: &Scenario) -> Vec<Finding> {
    let loops = loops(scenario);
    if loops.is_empty() {
        return Vec::new();
    }
    let text: Vec<String> = loops.iter().map(VelocityLoop::describe).collect();
    vec![Finding {
        name: "velocity_loops".into(),
        text: text.join("\n"),
        value: serde_json::to_value(&loops).unwrap_or_default(),
        warnings: loops.iter().filter_map(VelocityLoop::warning).collect(),
    }]
}

impl VelocityLoop {
    fn describe(&self) -> String {
        if self.configurations.is_empty() {
            return self.not_analysed_text();
        }
        let mut text = format!(
            "velocity loop of {}, {:.1} ms of delay before it and {:.1} ms behind it: spectral radius",
            self.controller,
            1e3 * self.measured_delay_s,
            1e3 * self.command_delay_s
        );
        for one in &self.configurations {
            let margin = match (one.stable(), one.with_margin()) {
                (true, true) => format!(
                    "stable, also with gains {GAIN_MARGIN} times as large and {DELAY_MARGIN_PERIODS} of a period later"
                ),
                (true, false) => "stable without margin".to_owned(),
                (false, _) => "unstable".to_owned(),
            };
            text += &format!("\n  {:<24} {:.5} ({margin})", one.name, one.spectral_radius);
        }
        text
    }

    fn not_analysed_text(&self) -> String {
        format!(
            "the stability of the velocity loop is not analysed: {:.1} s of delay around it are more than {DELAY_MAX_PERIODS} periods of the \
             controller",
            self.measured_delay_s + self.command_delay_s
        )
    }

    fn warning(&self) -> Option<String> {
        if self.configurations.is_empty() {
            return Some(format!(
                "participants.{}.parameters.gains: {}",
                self.controller,
                self.not_analysed_text()
            ));
        }
        let worst = |largest: fn(&ConfigurationStability) -> f64| {
            let all = self.configurations.iter();
            all.max_by(|a, b| largest(a).total_cmp(&largest(b)))
        };
        type Radius = fn(&ConfigurationStability) -> f64;
        let checks: [(Radius, &str, String); 3] = [
            (|one| one.spectral_radius, "unstable", String::new()),
            (
                |one| one.with_larger_gains,
                "close to instability",
                format!("with gains {GAIN_MARGIN} times as large: "),
            ),
            (
                |one| one.with_more_delay,
                "close to instability",
                format!("with commands {DELAY_MARGIN_PERIODS} of a period later: "),
            ),
        ];
        let (one, what, with) = checks.into_iter().find_map(|(radius, what, with)| {
            let one = worst(radius).filter(|one| !SampledLoop::is_stable(radius(one)))?;
            Some((one, what, format!("{with}spectral radius {:.5}", radius(one))))
        })?;
        let joints: Vec<String> = one.joints_deg.iter().map(|q| format!("{q:.1}")).collect();
        Some(format!(
            "participants.{}.parameters.gains: the velocity loop is {what} at the {} ({with}; {:.1} ms of delay before the controller, \
             {:.1} ms behind it); name gains tuned for these delays and joints_deg = [{}], or shorten the delays",
            self.controller,
            one.name,
            1e3 * self.measured_delay_s,
            1e3 * self.command_delay_s,
            joints.join(", ")
        ))
    }
}

fn analyse_loop(scenario: &Scenario, controller: &Entry) -> Option<VelocityLoop> {
    let name = &controller.setup.name;
    let (plant, measured) = source_of_input(scenario, &format!("{name}.measured"), "plant", "measured")?;
    let (commanding, command) = source_of_input(
        scenario,
        &format!("{}.command", plant.setup.name),
        "controller",
        "command",
    )?;
    if commanding.setup.name != *name {
        return None;
    }
    let guidance = source_of_input(scenario, &format!("{name}.setpoint"), "guidance", "setpoint");
    let configurations = match guidance {
        Some((guidance, _)) => path::path(&plant.setup, &controller.setup, &guidance.setup)?,
        None => vec![path::start(&plant.setup)?],
    };
    let drop_delay_s = |timing: &Timing| {
        if timing.drop > 0.0 {
            controller.setup.period
        } else {
            0.0
        }
    };
    let largest_delay_s = |timing: &Timing| timing.delay.seconds() + timing.jitter.seconds() + drop_delay_s(timing);
    let timing = LoopTiming {
        controller_period_s: controller.setup.period,
        tick_s: controller.setup.period / (controller.setup.period / plant.setup.period - 1e-9).ceil().max(1.0),
        sensor_delay_s: largest_delay_s(&measured) + sampling_delay(plant, &measured, controller.setup.period),
        command_delay_s: largest_delay_s(&command),
        lag_s: actuator_lags(plant),
    };
    let gains = controller_proc::VelocityLoop::new(&controller.setup).ok()?;
    let robot = robot(&plant.setup)?;
    let loop_delay_s = timing.sensor_delay_s + timing.command_delay_s;
    let analysed = loop_delay_s <= DELAY_MAX_PERIODS * timing.controller_period_s;
    let assessed = configurations
        .into_iter()
        .filter(|_| analysed)
        .map(|configuration| analyse_configuration(&timing, &robot, &gains, configuration));
    Some(VelocityLoop {
        controller: name.clone(),
        measured_delay_s: timing.sensor_delay_s,
        command_delay_s: timing.command_delay_s,
        configurations: assessed.collect::<Result<_, _>>().ok()?,
    })
}

fn analyse_configuration(
    timing: &LoopTiming,
    robot: &Robot,
    gains: &controller_proc::VelocityLoop,
    configuration: Configuration,
) -> Result<ConfigurationStability, RobotError> {
    let mut model = ModelSpec::nominal(configuration.joints_deg.clone());
    model.slosh = true;
    let body = robot.linearise(&model)?;
    let matrix = |rows: &[[f64; 13]; 13]| Matrix::from_fn(13, 13, |i, j| rows[i][j]);
    let mut kp = matrix(&gains.kp);
    if gains.scheduled {
        let root = linalg::sqrt_spd(&body.mass)?;
        kp = &root * &kp * &root;
    }
    let ki = gains.ki.as_ref().map_or(Matrix::zeros(13, 0), matrix);
    let sampled = SampledLoop::new(timing, &body, &kp, &ki)?;
    Ok(ConfigurationStability {
        name: configuration.name,
        joints_deg: configuration.joints_deg,
        spectral_radius: sampled.radius(1.0, 0.0)?,
        with_larger_gains: sampled.radius(GAIN_MARGIN, 0.0)?,
        with_more_delay: sampled.radius(1.0, DELAY_MARGIN_PERIODS * timing.controller_period_s)?,
    })
}

/// Whether `entry` is this stock participant.
fn is_builtin(entry: &Entry, name: &str) -> bool {
    matches!(&entry.program, Program::Builtin(builtin) if builtin == name)
}

/// The stock participant that feeds `input` from its `port`, and the link between them.
fn source_of_input<'a>(scenario: &'a Scenario, input: &str, builtin: &str, port: &str) -> Option<(&'a Entry, Timing)> {
    let (from, timing) = scenario
        .links()
        .find_map(|(from, to, timing)| (to == input).then_some((from, timing)))?;
    let (name, output) = from.split_once('.')?;
    let entry = scenario.participants.iter().find(|entry| entry.setup.name == name)?;
    (is_builtin(entry, builtin) && output == port).then_some((entry, timing))
}

/// The robot that the plant moves.
fn robot(plant: &Setup) -> Option<Robot> {
    let servicer: Servicer = lockstep::units::read(table(&plant.parameters, "servicer")?).ok()?;
    let urdf = plant.parameters.get("urdf").and_then(Value::as_str)?;
    let options = UrdfOptions {
        allow_unphysical: servicer.allow_unphysical,
    };
    let mut description = Description::read_urdf(urdf, options).ok()?.description;
    for (joint, inertia) in servicer.arm.joints.iter().zip(servicer.arm.motor_inertia.si()) {
        description.add_motor_inertia(joint, inertia).ok()?;
    }
    let slosh: Vec<&String> = {
        let exists = |joint: &&String| description.moving_joints().any(|one| one.name == **joint);
        servicer.slosh.joints.iter().filter(exists).collect()
    };
    let is_child = |link: usize| description.joints.iter().any(|joint| joint.child == link);
    let root = (0..description.links.len()).find(|link| !is_child(*link))?;
    let spec = RobotSpec {
        urdf: String::new(),
        frozen: slosh.iter().map(|joint| ((*joint).clone(), 0.0)).collect(),
        motor_inertia_kg_m2: 0.0,
        base_link: description.links[root].name.clone(),
        arm_links: Vec::new(),
        propellant_links: Vec::new(),
        end_effector: servicer.arm.end_effector,
    };
    for joint in slosh {
        if let Some(damping) = servicer.slosh.damping {
            description.set_damping(joint, damping.si()).ok()?;
        }
    }
    Robot::from_description(description, &spec).ok()
}

/// The lags of wheels, thrusters and joint motors, channel by channel, s.
fn actuator_lags(plant: &Entry) -> Vec<f64> {
    let actuators = table(&plant.setup.parameters, "actuators");
    let lag = |group: &str| {
        actuators
            .and_then(|all| table(all, group))
            .and_then(|own| time(own, "lag"))
    };
    let groups = [("wheels", 3), ("thrusters", 3), ("joints", 7)];
    let lags = groups
        .into_iter()
        .map(|(group, count)| vec![lag(group).unwrap_or(0.0); count]);
    lags.flatten().collect()
}

/// The age of a rate that a sensor samples and holds, s: zero where the controller reads it at the instants of the sensor.
fn sampling_delay(plant: &Entry, link: &Timing, period: f64) -> f64 {
    let sensors = table(&plant.setup.parameters, "sensors");
    let every = |sensor: &str| {
        sensors
            .and_then(|all| table(all, sensor))
            .and_then(|own| time(own, "period"))
    };
    let fits = |time: f64, every: f64| (time / every - (time / every).round()).abs() < 1e-9;
    let periods = ["rate", "velocity", "joint_rate"].into_iter().filter_map(every);
    let unaligned = periods.filter(|every| !(fits(period, *every) && fits(link.delay.seconds(), *every)));
    unaligned.fold(0.0, f64::max)
}

fn table<'a>(table: &'a Table, key: &str) -> Option<&'a Table> {
    table.get(key).and_then(Value::as_table)
}
