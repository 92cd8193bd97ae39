//! The points that a worker has under way: each goes on to a step that can be done beside those of others, and then these are done together.

use std::cell::Cell;
use std::sync::Arc;

use lockstep::participant::{Pending, Stride};

use super::point::{Begun, Order, Result as PointResult, caught};
use crate::Catalogue;
use crate::run::Abreast;

/// Points under way in this process.
pub struct Points {
    catalogue: Arc<Catalogue>,
    under_way: Vec<Point>,
    stride: Stride,
}

struct Point {
    ticket: u64,
    order: Order,
    run: Box<Abreast>,
}

/// A point that is over: its ticket and what became of it.
pub type Over = (u64, PointResult);

impl Points {
    /// None yet, of programs in `catalogue`.
    pub fn new(catalogue: Arc<Catalogue>) -> Points {
        Points {
            catalogue,
            under_way: Vec::new(),
            stride: Stride::default(),
        }
    }

    /// Whether none is under way.
    pub fn is_empty(&self) -> bool {
        self.under_way.is_empty()
    }

    /// Begins a point, beside the others if it can go so and is not to go `alone`. Gives it back when it is over already.
    pub fn begin(&mut self, ticket: u64, order: Order, alone: bool) -> Option<Over> {
        match order.begin(&self.catalogue, alone) {
            Begun::Over(result) => Some((ticket, result)),
            Begun::Abreast(run) => {
                self.under_way.push(Point { ticket, order, run });
                None
            }
        }
    }

    /// Every point goes on by a step. Gives those that are over.
    pub fn advance(&mut self) -> Vec<Over> {
        let mut over = Vec::new();
        let (under_way, stride) = (&mut self.under_way, &mut self.stride);
        // The point that goes on by itself; none while the steps of all are done.
        let by_itself = Cell::new(None);
        let unharmed = caught(|| {
            for _ in 0..STRIDE {
                let mut at = 0;
                while at < under_way.len() {
                    by_itself.set(Some(at));
                    if under_way[at].run.advance() {
                        at += 1;
                    } else {
                        let Point { ticket, order, run } = under_way.remove(at);
                        over.push((ticket, order, run));
                    }
                }
                by_itself.set(None);
                let mut pending: Vec<Pending> = under_way.iter_mut().filter_map(|point| point.run.pending()).collect();
                stride.step(&mut pending);
                if !over.is_empty() || under_way.is_empty() {
                    break;
                }
            }
        });
        let over = over.into_iter();
        let mut over: Vec<Over> = over
            .map(|(ticket, order, run)| (ticket, order.concluded(run)))
            .collect();
        match (unharmed, by_itself.get()) {
            (Ok(()), _) => {}
            (Err(result), Some(at)) => {
                let point = self.under_way.remove(at);
                over.push((point.ticket, result));
                // What a panic has left behind may panic again.
                let _ = caught(|| drop(point.run));
            }
            // Whose step it was is not known, and all are half done: each is run again by itself.
            (Err(_), None) => {
                for Point { ticket, order, run } in std::mem::take(&mut self.under_way) {
                    let _ = caught(|| drop(run));
                    if let Begun::Over(result) = order.begin(&self.catalogue, true) {
                        over.push((ticket, result));
                    }
                }
            }
        }
        over
    }
}

/// So many steps are done before new points are looked for, and between two settings of what catches a panic.
const STRIDE: usize = 64;
