//! Points that one worker runs side by side: each advances to a step that can be computed in the lanes of the others, and
//! these steps are then computed together.

use std::cell::Cell;
use std::sync::Arc;

use lockstep::participant::{Pending, Stride};

use super::point::{Begun, Order, Result as PointResult, caught};
use crate::Catalogue;
use crate::run::BatchedRun;

/// Points under way in this process.
pub struct Points {
    catalogue: Arc<Catalogue>,
    under_way: Vec<Point>,
    stride: Stride,
}

struct Point {
    ticket: u64,
    order: Order,
    run: Box<BatchedRun>,
}

/// A point that is over: its ticket and its result.
pub type Over = (u64, PointResult);

impl Points {
    /// Creates the set without points; their programs are in `catalogue`.
    pub fn new(catalogue: Arc<Catalogue>) -> Points {
        Points {
            catalogue,
            under_way: Vec::new(),
            stride: Stride::default(),
        }
    }

    /// Whether no point is under way.
    pub fn is_empty(&self) -> bool {
        self.under_way.is_empty()
    }

    /// Begins a point, beside the others where it supports that and is not to run `alone`. Returns the point if it is
    /// already over.
    pub fn begin(&mut self, ticket: u64, order: Order, alone: bool) -> Option<Over> {
        match order.begin(&self.catalogue, alone) {
            Begun::Over(result) => Some((ticket, result)),
            Begun::Abreast(run) => {
                self.under_way.push(Point { ticket, order, run });
                None
            }
        }
    }

    /// Advances every point by a step. Returns the points that are over.
    pub fn advance(&mut self) -> Vec<Over> {
        let mut over = Vec::new();
        let (under_way, stride) = (&mut self.under_way, &mut self.stride);
        // The point that advances alone at the moment; none while the steps of all points are computed.
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
                // The state that a panic left behind may panic again when dropped.
                let _ = caught(|| drop(point.run));
            }
            // Which point's step panicked is not known, and every step is half done: each point is run again alone.
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

/// Number of steps before the worker looks for new points, and between two set-ups of the panic handler.
const STRIDE: usize = 64;
