//! SIMD stepping of several plants at once: the costly parts of a step, the integration and the body quantities of the truth message, are
//! computed for all of them in the lanes of the processor.

use lockstep::participant::{Abreast, StepAbreast};
use multibody::{F64x4, Lanes, Method};

use crate::dynamics::{Bodies, Models, Under};
use crate::plant::{Plant, TRUTH};

/// Mechanisms packed into SIMD lanes, kept from one step to the next.
#[derive(Debug, Default)]
pub struct Known {
    /// Models of each group.
    models: Vec<Option<Box<Models<F64x4>>>>,
}

/// Properties that plants must share to be stepped together in SIMD lanes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Shape {
    substeps: u32,
    h: f64,
    held: bool,
    compensated: [bool; 3],
}

/// A plant and the period of its step.
struct Moving<'a> {
    plant: &'a mut Plant,
    shape: Option<Shape>,
    period: f64,
    told: bool,
    bodies: &'a mut Option<Bodies>,
}

impl Shape {
    /// `None` for a plant that must be stepped alone.
    fn of(plant: &Plant, period: f64) -> Option<Shape> {
        let alone = plant.method != Method::Rk4 || plant.model.sphere.is_some() || plant.forces.braked.contains(&true);
        (!alone).then(|| Shape {
            substeps: plant.substeps,
            h: period / f64::from(plant.substeps),
            held: plant.grasp.is_some(),
            compensated: plant.forces.compensated,
        })
    }
}

impl StepAbreast for Plant {
    type Common = Known;

    fn step_abreast(those: &mut [Abreast<'_, Plant>], known: &mut Known) {
        let mut bodies: Vec<Option<Bodies>> = vec![None; those.len()];
        let moving = those.iter_mut().zip(&mut bodies).map(|(one, bodies)| {
            let (plant, period) = (&mut *one.participant, one.step.period);
            plant.begin(&one.step, one.inputs);
            Moving {
                shape: Shape::of(plant, period),
                plant,
                period,
                told: one.outputs.is_seen(TRUTH),
                bodies,
            }
        });
        move_all(moving.collect(), known);
        for (one, bodies) in those.iter_mut().zip(&bodies) {
            let next = one.step.index + 1;
            one.participant
                .write(next, one.step.t_next, bodies.as_ref(), one.outputs);
        }
    }
}

/// Integrates each plant over its step: plants of one shape together, as many as there are lanes.
fn move_all(mut left: Vec<Moving>, known: &mut Known) {
    let mut group = 0;
    while !left.is_empty() {
        let shape = left[0].shape;
        let mut those: Vec<Moving> = Vec::with_capacity(F64x4::WIDTH);
        let mut others = Vec::new();
        for one in left {
            match shape.is_some() && one.shape == shape && those.len() < F64x4::WIDTH {
                true => those.push(one),
                false if those.is_empty() => those.push(one),
                false => others.push(one),
            }
        }
        left = others;
        let moved = match shape {
            Some(shape) if those.len() > 1 => side_by_side(&mut those, &shape, &mut known.models, group),
            _ => false,
        };
        for one in those {
            match moved {
                true => one.plant.carry(),
                false => one.plant.integrate(one.period),
            }
        }
        group += 1;
    }
}

/// Returns `false` when nothing was done: the plants must then be stepped alone.
fn side_by_side(
    those: &mut [Moving],
    shape: &Shape,
    known: &mut Vec<Option<Box<Models<F64x4>>>>,
    group: usize,
) -> bool {
    known.resize_with(known.len().max(group + 1), || None);
    let under = those.iter_mut().map(|one| one.plant.under(one.told, one.bodies));
    let mut all: Vec<Under> = under.collect();
    let Some(models) = Models::of(known[group].take(), &all) else {
        return false;
    };
    models.step(&mut all, shape.h, shape.substeps, !shape.held);
    known[group] = Some(models);
    true
}
