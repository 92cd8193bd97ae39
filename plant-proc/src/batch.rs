//! SIMD stepping of several plants at once: the costly parts of a step, the integration and the body quantities of the truth message, are
//! computed for all of them in the lanes of the processor.

use lockstep::participant::{BatchedStep, StepBatch};
use multibody::{Method, lanes_max};

use crate::dynamics::{BodyQuantities, PackedModels, SteppedPlant, pack_models};
use crate::plant::{Plant, TRUTH};

/// Mechanisms packed into SIMD lanes, kept from one step to the next: the models of each group.
#[derive(Debug, Default)]
pub struct PackedGroups(Vec<Option<Box<dyn PackedModels>>>);

/// Properties that plants must share to be stepped together in SIMD lanes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct BatchKey {
    substeps: u32,
    h: f64,
    held: bool,
    compensated: [bool; 3],
}

/// A plant and the period of its step.
struct PendingPlant<'a> {
    plant: &'a mut Plant,
    key: Option<BatchKey>,
    period: f64,
    truth_requested: bool,
    bodies: &'a mut Option<BodyQuantities>,
}

impl BatchKey {
    /// `None` for a plant that must be stepped alone.
    fn of(plant: &Plant, period: f64) -> Option<BatchKey> {
        let alone =
            plant.method != Method::Rk4 || plant.model.spherical.is_some() || plant.forces.braked.contains(&true);
        (!alone).then(|| BatchKey {
            substeps: plant.substeps,
            h: period / f64::from(plant.substeps),
            held: plant.grasp.is_some(),
            compensated: plant.forces.compensated,
        })
    }
}

impl StepBatch for Plant {
    type Common = PackedGroups;

    fn efficient_size() -> usize {
        // elsewhere the lanes are loops
        if cfg!(target_arch = "x86_64") { lanes_max() } else { 1 }
    }

    fn step_batch(plants: &mut [BatchedStep<'_, Plant>], packed: &mut PackedGroups) {
        let mut bodies: Vec<Option<BodyQuantities>> = vec![None; plants.len()];
        let pending = plants.iter_mut().zip(&mut bodies).map(|(one, bodies)| {
            let (plant, period) = (&mut *one.participant, one.step.period);
            plant.begin_step(&one.step, one.inputs);
            PendingPlant {
                key: BatchKey::of(plant, period),
                plant,
                period,
                truth_requested: one.outputs.is_seen(TRUTH),
                bodies,
            }
        });
        integrate_all(pending.collect(), packed);
        for (one, bodies) in plants.iter_mut().zip(&bodies) {
            let next = one.step.index + 1;
            one.participant
                .write_outputs(next, one.step.t_next, bodies.as_ref(), one.outputs);
        }
    }
}

/// Integrates each plant over its step: plants with equal keys together, as many as there are lanes.
fn integrate_all(mut remaining: Vec<PendingPlant>, packed: &mut PackedGroups) {
    let lanes = lanes_max();
    let mut group = 0;
    while !remaining.is_empty() {
        let key = remaining[0].key;
        let mut plants: Vec<PendingPlant> = Vec::with_capacity(lanes);
        let mut others = Vec::new();
        for one in remaining {
            match key.is_some() && one.key == key && plants.len() < lanes {
                true => plants.push(one),
                false if plants.is_empty() => plants.push(one),
                false => others.push(one),
            }
        }
        remaining = others;
        let batched = match key {
            Some(key) if plants.len() > 1 => integrate_batch(&mut plants, &key, &mut packed.0, group),
            _ => false,
        };
        for one in plants {
            match batched {
                true => one.plant.update_held_target(),
                false => one.plant.integrate(one.period),
            }
        }
        group += 1;
    }
}

/// Returns `false` when nothing was done: the plants must then be stepped alone.
fn integrate_batch(
    plants: &mut [PendingPlant],
    key: &BatchKey,
    packed: &mut Vec<Option<Box<dyn PackedModels>>>,
    group: usize,
) -> bool {
    packed.resize_with(packed.len().max(group + 1), || None);
    let parts = plants
        .iter_mut()
        .map(|one| one.plant.stepped_parts(one.truth_requested, one.bodies));
    let mut all: Vec<SteppedPlant> = parts.collect();
    let models = match packed[group].take() {
        Some(models) if models.are_of(&all) => Some(models),
        _ => pack_models(&all),
    };
    let Some(models) = models else {
        return false;
    };
    models.step(&mut all, key.h, key.substeps, !key.held);
    packed[group] = Some(models);
    true
}
