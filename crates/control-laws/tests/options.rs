//! Every option of the hierarchical law has its intended effect in a closed loop.

mod plant;

use control_laws::allocation::AllocationParameters;
use control_laws::avoidance::{AvoidanceParameters, Elbow};
use control_laws::inner::{Bound, Discretisation, FeedbackLaw, Gains};
use control_laws::model::{LinkMismatch, Propellant};
use control_laws::outer::{ArmWeight, AttitudeLaw};
use control_laws::tracker::TrackedVelocity;
use control_laws::{ControlModel, Dof, HierarchicalLaw, Matrix13, ModelOptions, hierarchical};
use guidance_laws::capture::Schedule;
use guidance_laws::{Pose, SetPoint, so3};
use nalgebra::Vector3;
use plant::loops::{baseline, hierarchical_loop, model};
use plant::{DEGREE, Figures, KI, KP, LIMITS, Plant, description, run};
use std::collections::VecDeque;

fn run_close_with(model: ControlModel, parameters: hierarchical::Parameters, plant: Plant) -> Figures {
    let law = HierarchicalLaw::new(model, parameters).unwrap();
    let mut step = hierarchical_loop(law, Schedule::CLOSE);
    let law = |time_s: f64, plant: &Plant| step(time_s, plant).force;
    let figures = run(plant, 35.0, 30.0, parameters.tracker.period_s, law).0;
    println!("{figures:?}");
    figures
}

fn run_close(parameters: hierarchical::Parameters) -> Figures {
    run_close_with(model(), parameters, Plant::new(1.2, 1.0))
}

fn is_captured(figures: &Figures) -> bool {
    figures.position_error_m < 5e-3 && figures.attitude_error_deg < 0.5 && figures.relative_speed_m_s < 5e-3
}

fn conditional(bound: Bound, discretisation: Discretisation) -> FeedbackLaw {
    FeedbackLaw::ConditionalIntegrator { bound, discretisation }
}

#[test]
fn every_inner_loop_captures() {
    let actuators = Bound::PerChannel(Dof::from(LIMITS));
    // the paper's single number for all channels: the norm of the limits
    let scalar = Bound::Scalar(Dof::from(LIMITS).norm());
    let mut coupled_kp = Matrix13::from_diagonal(&Dof::from(KP));
    coupled_kp[(0, 4)] = 20.0;
    coupled_kp[(4, 0)] = 20.0;
    let full = Gains::full(coupled_kp, Matrix13::from_diagonal(&Dof::from(KI)));
    // K_P is M times the cut-offs in every configuration
    let cut_offs = [1.5, 1.5, 1.5, 1.0, 1.0, 1.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0];
    let scheduled = Gains::scheduled(Matrix13::from_diagonal(&Dof::from(cut_offs)), &Dof::from(KI));
    let diagonal = baseline().tracker.gains;
    for (gains, feedback) in [
        (diagonal, conditional(actuators, Discretisation::Euler)),
        (diagonal, conditional(scalar, Discretisation::Exact)),
        (diagonal, FeedbackLaw::ProportionalIntegral),
        (full, conditional(actuators, Discretisation::Exact)),
        (scheduled, conditional(actuators, Discretisation::Exact)),
        (scheduled, conditional(actuators, Discretisation::Euler)),
    ] {
        let mut parameters = baseline();
        parameters.tracker.gains = gains;
        parameters.tracker.feedback = feedback;
        let figures = run_close(parameters);
        assert!(is_captured(&figures) && figures.saturated == 0.0, "{feedback:?}");
    }
}

/// A thruster that leaks half a newton: the integral rejects it.
#[test]
fn integral_rejects_constant_disturbance_proportional_does_not() {
    let leaking = |feedback| {
        let mut parameters = baseline();
        parameters.tracker.feedback = feedback;
        let law = HierarchicalLaw::new(model(), parameters).unwrap();
        let mut step = hierarchical_loop(law, Schedule::CLOSE);
        let mut leak = Dof::zeros();
        leak[4] = 0.5;
        let law = |time_s: f64, plant: &Plant| step(time_s, plant).force + leak;
        run(Plant::new(1.2, 1.0), 35.0, 30.0, 0.01, law).0.position_error_m
    };
    let without = leaking(FeedbackLaw::Proportional);
    let with = leaking(baseline().tracker.feedback);
    println!("{with} {without}");
    assert!(without > 5.0 * with && with < 3e-4);
}

#[test]
fn every_outer_loop_captures() {
    for attitude in [AttitudeLaw::RotationMatrix, AttitudeLaw::Quaternion] {
        let mut parameters = baseline();
        parameters.outer.attitude = attitude;
        assert!(is_captured(&run_close(parameters)), "{attitude:?}");
    }
    let mut filtered = baseline();
    filtered.tracker.followed = TrackedVelocity::Filtered;
    assert!(is_captured(&run_close(filtered)));
}

#[test]
fn locked_joint_rests_and_the_others_compensate() {
    let free = run_close(baseline());
    assert!(
        free.joint_high_deg[2] - free.joint_low_deg[2] > 5.0,
        "A3 moves when it may"
    );
    let mut parameters = baseline();
    parameters.outer.weights.joint_factor[2] = 0.0;
    let locked = run_close(parameters);
    assert!(is_captured(&locked));
    assert!(locked.joint_high_deg[2] - locked.joint_low_deg[2] < 0.02);
}

#[test]
fn capture_tolerates_mass_errors_of_a_fifth() {
    for mass_factor in [0.8, 1.2] {
        let options = ModelOptions {
            mass_factor,
            mismatch: vec![LinkMismatch {
                link: "base".to_owned(),
                mass_factor: 1.0,
                inertia_factor: mass_factor,
            }],
            ..ModelOptions::default()
        };
        let model = ControlModel::new(&description(), &options).unwrap();
        let figures = run_close_with(model, baseline(), Plant::new(1.2, 1.0));
        assert!(is_captured(&figures) && figures.saturated == 0.0, "{mass_factor}");
    }
    let options = ModelOptions {
        propellant: Propellant::Ignored,
        ..ModelOptions::default()
    };
    let model = ControlModel::new(&description(), &options).unwrap();
    assert!(is_captured(&run_close_with(model, baseline(), Plant::new(1.2, 1.0))));
}

/// Wheels with a quarter of their torque: the conditional integrator is active.
#[test]
fn conditional_integrator_beats_pi_law_with_weak_wheels() {
    let mut weak = Plant::new(1.2, 1.0);
    weak.limits[..3].fill(0.05);
    let mut parameters = baseline();
    parameters.tracker.feedback = conditional(Bound::PerChannel(Dof::from(weak.limits)), Discretisation::Exact);
    let conditional = run_close_with(model(), parameters, weak.clone());
    assert!(is_captured(&conditional) && conditional.wheels_over > 0.1);
    parameters.tracker.feedback = FeedbackLaw::ProportionalIntegral;
    let plain = run_close_with(model(), parameters, weak);
    assert!(plain.position_error_m > 5.0 * conditional.position_error_m, "wind-up");
    assert!(plain.attitude_error_deg > 5.0 * conditional.attitude_error_deg);
}

/// The command is delayed by `samples`, and the measurement by the same number.
fn run_with_delay(samples: usize) -> Figures {
    let law = HierarchicalLaw::new(model(), baseline()).unwrap();
    let mut step = hierarchical_loop(law, Schedule::CLOSE);
    let (mut seen, mut commanded) = (VecDeque::new(), VecDeque::new());
    let law = |time_s: f64, plant: &Plant| {
        seen.push_back(plant.clone());
        let command = match seen.len() > samples {
            false => Dof::zeros(),
            true => {
                let mut old = seen.pop_front().unwrap();
                old.target = plant.target; // only the servicer's own state is late
                step(time_s, &old).force
            }
        };
        commanded.push_back(command);
        if commanded.len() > samples {
            commanded.pop_front().unwrap()
        } else {
            Dof::zeros()
        }
    };
    let figures = run(Plant::new(1.2, 1.0), 35.0, 30.0, 0.01, law).0;
    println!("{samples} samples late: {figures:?}");
    figures
}

#[test]
fn capture_tolerates_10_ms_delay_each_way_but_not_50_ms() {
    let figures = run_with_delay(1);
    assert!(is_captured(&figures) && figures.saturated == 0.0);
    assert!(!is_captured(&run_with_delay(5)));
}

/// An arm that carries nearly all the motion (weight 1000) and starts too near must fold: the law as printed has no joint limits.
#[test]
fn avoidance_keeps_a_folding_arm_within_its_ranges_and_captures() {
    let ranges: Vec<_> = description().moving_joints().filter_map(|joint| joint.limits).collect();
    let mut parameters = baseline();
    parameters.outer.weights.arm = ArmWeight::Fixed(1000.0);
    let printed = run_close_with(model(), parameters, Plant::new(0.8, 1.0));
    assert!(is_captured(&printed));
    assert!(
        printed.joint_high_deg[3] > 130.0 && printed.joint_high_deg[5] > 130.0,
        "of 120 degrees"
    );
    parameters.avoidance = Some(AvoidanceParameters {
        lower_rad: std::array::from_fn(|joint| ranges[joint].lower),
        upper_rad: std::array::from_fn(|joint| ranges[joint].upper),
        margin_rad: 0.5,
        rate_rad_s: 0.2,
        elbow: None,
    });
    let avoiding = run_close_with(model(), parameters, Plant::new(0.8, 1.0));
    assert!(is_captured(&avoiding) && avoiding.saturated == 0.0);
    for (joint, range) in ranges.iter().enumerate() {
        assert!(avoiding.joint_low_deg[joint] * DEGREE > range.lower, "A{}", joint + 1);
        assert!(avoiding.joint_high_deg[joint] * DEGREE < range.upper, "A{}", joint + 1);
    }
}

/// The same arm, starting too far away, must stretch.
#[test]
fn avoidance_keeps_the_elbow_bent() {
    let ranges: Vec<_> = description().moving_joints().filter_map(|joint| joint.limits).collect();
    let mut parameters = baseline();
    parameters.outer.weights.arm = ArmWeight::Fixed(1e4);
    let printed = run_close(parameters);
    assert!(printed.joint_low_deg[3] < 1.0, "straight");
    parameters.avoidance = Some(AvoidanceParameters {
        lower_rad: std::array::from_fn(|joint| ranges[joint].lower),
        upper_rad: std::array::from_fn(|joint| ranges[joint].upper),
        margin_rad: 0.5,
        rate_rad_s: 0.2,
        elbow: Some(Elbow {
            joint: 3,
            margin_rad: 0.5,
            rate_rad_s: 0.5,
        }),
    });
    let avoiding = run_close(parameters);
    assert!(is_captured(&avoiding));
    assert!(avoiding.joint_low_deg[3] > 8.0);
    assert!(
        avoiding.peak_torque_nm < printed.peak_torque_nm,
        "a straight arm is expensive"
    );
}

/// Weak wheels supported by thrusters: the base receives the commanded torque, and stored momentum is unloaded.
#[test]
fn reallocation_gives_the_whole_torque_and_sheds_momentum() {
    let allocation = AllocationParameters {
        wheel_torque_nm: Vector3::repeat(0.05),
        wheel_momentum_nms: Vector3::repeat(12.0),
        thruster_force_n: Vector3::repeat(9.0),
        lever_arm_m: Vector3::repeat(0.45),
        unload_rate_1_s: 0.05,
        unload_above_nms: 0.5,
    };
    let mut parameters = baseline();
    parameters.allocation = Some(allocation);
    let law = HierarchicalLaw::new(model(), parameters).unwrap();
    let mut step = hierarchical_loop(law, Schedule::CLOSE);
    let (mut missing, mut thruster_assisted_steps, mut momentum) = (0.0_f64, 0, Vector3::new(6.0, -6.0, 0.0));
    let law = |time_s: f64, plant: &Plant| {
        let force = step(time_s, plant).force;
        let torque = force.fixed_rows::<3>(0).into_owned();
        let allocated = allocation.allocate(&torque, &force.fixed_rows::<3>(3).into_owned(), &momentum);
        momentum -= allocated.wheel_torque * 0.01;
        missing = missing.max(allocated.missing_torque.amax());
        thruster_assisted_steps += u32::from(allocated.thruster_torque.amax() > 0.0);
        force
    };
    let figures = run(Plant::new(1.2, 1.0), 35.0, 30.0, 0.01, law).0;
    assert!(is_captured(&figures));
    assert!(missing < 1e-12 && thruster_assisted_steps > 1000);
    assert!(momentum.amax() < 5.0, "{momentum}");
}

/// A set-point that turns faster than the servicer can follow, and stops after 280 degrees: angle turned (deg), final error (deg), jump.
fn follow_fast_rotation(attitude: AttitudeLaw) -> (f64, f64, bool) {
    let mut parameters = baseline();
    parameters.outer.attitude = attitude;
    // the base alone, with wheels strong enough to brake as the outer loop asks
    parameters.outer.weights.arm = ArmWeight::Fixed(0.0);
    let mut plant = Plant::new(1.0, 1.0);
    plant.limits[..6].fill(20.0);
    parameters.tracker.feedback = conditional(Bound::PerChannel(Dof::from(plant.limits)), Discretisation::Exact);
    let mut law = HierarchicalLaw::new(model(), parameters).unwrap();
    let start = law.model().end_effector(&plant.measured()).pose;
    let (mut turned, mut jumped) = (0.0, false);
    for sample in 0..3_000 {
        let time_s = 0.01 * f64::from(sample);
        let angle = (4.0 * time_s).min(280.0 * DEGREE);
        let moving = angle < 280.0 * DEGREE;
        let axis = Vector3::new(0.0, 0.0, 1.0);
        let set_point = SetPoint {
            pose: Pose {
                position: start.position,
                attitude: so3::exp(&(axis * angle)) * start.attitude,
            },
            velocity: Vector3::zeros(),
            rate: if moving {
                start.attitude.inverse() * axis * 4.0
            } else {
                Vector3::zeros()
            },
        };
        let output = law
            .step(&hierarchical::Input {
                measured: Some(plant.measured()),
                set_point: Some(set_point),
                set_point_age_s: 0.0,
                wheel_momentum: Vector3::zeros(),
            })
            .unwrap();
        jumped |= output.telemetry.attitude_error.jumped;
        for _ in 0..10 {
            turned += plant.state.nu[2] * plant::PLANT_PERIOD_S;
            plant.step(&output.force);
        }
    }
    let end = law.model().end_effector(&plant.measured()).pose.attitude;
    let goal = so3::exp(&(Vector3::z() * (280.0 * DEGREE))) * start.attitude;
    (
        turned / DEGREE,
        so3::log(&(goal.inverse() * end)).norm() / DEGREE,
        jumped,
    )
}

#[test]
fn hybrid_law_takes_the_short_way_where_quaternion_unwinds() {
    let (turned, left, jumped) = follow_fast_rotation(AttitudeLaw::default());
    println!("hybrid: turned {turned:.1} deg, left {left:.3} deg");
    assert!(jumped && (turned + 80.0).abs() < 10.0 && left < 1.0);
    let (turned, left, jumped) = follow_fast_rotation(AttitudeLaw::Quaternion);
    println!("plain: turned {turned:.1} deg, left {left:.3} deg");
    assert!(!jumped && (turned - 280.0).abs() < 10.0 && left < 1.0);
}
