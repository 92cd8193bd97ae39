//! SIMD stepping of plants: random plants in random groups, each compared with itself stepped alone.

mod common;

use common::{begin, load, run};
use lockstep::executor::StopReason;
use lockstep::participant::BatchStepper;
use lockstep::random::Stream;
use toml::{Table, Value};

/// The close capture from a random state, with a random target, and occasionally with an option that prevents grouping.
fn random_scenario(number: u64) -> Table {
    let mut scenario = load("close");
    let mut drawn_values = 0_u64;
    let stream = Stream::new(29, "plants");
    let mut draw = |least: f64, most: f64| {
        drawn_values += 1;
        least + (most - least) * stream.uniform(1000 * number + drawn_values)
    };
    let mut list = |count: usize, size: f64, unit: &str| {
        let values: Vec<String> = (0..count).map(|_| format!("{:?}", draw(-size, size))).collect();
        Value::String(format!("[{}] {unit}", values.join(", ")))
    };
    let start = [
        ("attitude", list(3, 170.0, "deg")),
        ("rate", list(3, 5.0, "deg/s")),
        ("velocity", list(3, 0.3, "m/s")),
        ("joints", list(7, 150.0, "deg")),
        ("joint_rates", list(7, 20.0, "deg/s")),
        ("slosh", list(2, 60.0, "deg")),
        ("slosh_rates", list(2, 10.0, "deg/s")),
    ];
    let (rate, momentum) = (list(3, 20.0, "deg/s"), list(3, 11.0, "N m s"));
    let mass = draw(20.0, 900.0);
    let end = 30 + draw(0.0, 30.0) as i64;
    let kind = draw(0.0, 8.0) as usize;
    scenario.insert("duration".into(), Value::String(format!("{end} ms")));
    let plant = scenario["participants"]["plant"].as_table_mut().unwrap();
    if kind == 1 {
        plant.insert("period".into(), Value::String("2 ms".into()));
    }
    let own = plant["parameters"].as_table_mut().unwrap();
    for (key, value) in start {
        own["start"].as_table_mut().unwrap().insert(key.into(), value);
    }
    own["target_start"].as_table_mut().unwrap().insert("rate".into(), rate);
    own["target"]
        .as_table_mut()
        .unwrap()
        .insert("mass".into(), Value::String(format!("{mass:?} kg")));
    own["actuators"]["wheels"]
        .as_table_mut()
        .unwrap()
        .insert("start_momentum".into(), momentum);
    let changes = match kind {
        2 => "slosh = 'spherical'",
        3 => "integrator = { method = 'dop853', substeps = 1 }",
        4 => "integrator = { method = 'rk4', substeps = 2 }",
        5 => "after_grasp = { at = '7 ms', within = '100 m', within_angle = '180 deg' }",
        _ => "",
    };
    own.extend(changes.parse::<Table>().unwrap());
    scenario
}

#[test]
fn batched_plants_have_the_bits_of_single_plants() {
    // more than there are lanes, and fewer
    let mut first = 0;
    for count in [2, 8, 3, 5, 13, 1, 8] {
        let scenarios: Vec<Table> = (first..first + count).map(random_scenario).collect();
        let mut all: Vec<_> = scenarios.iter().map(begin).collect();
        all.iter_mut().for_each(|one| one.looped.defer_steps());
        let mut stride = BatchStepper::default();
        loop {
            let mut parked = 0;
            for one in &mut all {
                parked += usize::from(one.looped.run_to(one.plan.end, |_| {}).unwrap() == StopReason::Deferred);
            }
            if parked == 0 {
                break;
            }
            let mut pending: Vec<_> = all.iter_mut().filter_map(|one| one.looped.pending()).collect();
            assert_eq!(pending.len(), parked);
            stride.step(&mut pending);
        }
        for (number, (one, scenario)) in all.into_iter().zip(&scenarios).enumerate() {
            let (batched, alone) = (one.tape(), run(scenario));
            for (stream, name) in alone.streams.iter().enumerate() {
                assert!(alone.samples[stream].len() > 2, "{}", name.0);
                assert!(
                    batched.samples[stream] == alone.samples[stream],
                    "{} of plant {number} of {count} differs",
                    name.0
                );
            }
        }
        first += count;
    }
}
