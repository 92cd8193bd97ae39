//! Points that one worker runs side by side: each advances to a step that can be computed in the lanes of the others, and
//! these steps are then computed together.

use std::cell::Cell;
use std::sync::Arc;

use lockstep::participant::{BatchStepper, PendingStep};

use super::point::{PointRequest, Result as PointResult, StartedPoint, catch_panic};
use crate::Catalogue;
use crate::run::BatchedRun;

/// Points under way in this process.
pub struct PointBatch {
    catalogue: Arc<Catalogue>,
    active: Vec<Point>,
    stride: BatchStepper,
}

struct Point {
    ticket: u64,
    request: PointRequest,
    run: Box<BatchedRun>,
}

/// A point that is over: its ticket and its result.
pub type FinishedPoint = (u64, PointResult);

impl PointBatch {
    /// Creates the set without points; their programs are in `catalogue`.
    pub fn new(catalogue: Arc<Catalogue>) -> PointBatch {
        PointBatch {
            catalogue,
            active: Vec::new(),
            stride: BatchStepper::default(),
        }
    }

    /// Whether no point is under way.
    pub fn is_empty(&self) -> bool {
        self.active.is_empty()
    }

    /// Begins a point, beside the others where it supports that and is not to run `alone`. Returns the point if it is
    /// already over.
    pub fn start(&mut self, ticket: u64, request: PointRequest, alone: bool) -> Option<FinishedPoint> {
        match request.start(&self.catalogue, alone) {
            StartedPoint::Finished(result) => Some((ticket, result)),
            StartedPoint::Batched(run) => {
                self.active.push(Point { ticket, request, run });
                None
            }
        }
    }

    /// Advances every point by a step. Returns the points that are over.
    pub fn advance(&mut self) -> Vec<FinishedPoint> {
        let mut over = Vec::new();
        let (active, stride) = (&mut self.active, &mut self.stride);
        // The point that advances alone at the moment; none while the steps of all points are computed.
        let current = Cell::new(None);
        let outcome = catch_panic(|| {
            for _ in 0..STRIDE {
                let mut at = 0;
                while at < active.len() {
                    current.set(Some(at));
                    if active[at].run.advance() {
                        at += 1;
                    } else {
                        let Point { ticket, request, run } = active.remove(at);
                        over.push((ticket, request, run));
                    }
                }
                current.set(None);
                let mut pending: Vec<PendingStep> = active.iter_mut().filter_map(|point| point.run.pending()).collect();
                stride.step(&mut pending);
                if !over.is_empty() || active.is_empty() {
                    break;
                }
            }
        });
        let over = over.into_iter();
        let mut over: Vec<FinishedPoint> = over
            .map(|(ticket, request, run)| (ticket, request.finish(run)))
            .collect();
        match (outcome, current.get()) {
            (Ok(()), _) => {}
            (Err(result), Some(at)) => {
                let point = self.active.remove(at);
                over.push((point.ticket, result));
                // The state that a panic left behind may panic again when dropped.
                let _ = catch_panic(|| drop(point.run));
            }
            // Which point's step panicked is not known, and every step is half done: each point is run again alone.
            (Err(_), None) => {
                for Point { ticket, request, run } in std::mem::take(&mut self.active) {
                    let _ = catch_panic(|| drop(run));
                    if let StartedPoint::Finished(result) = request.start(&self.catalogue, true) {
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
