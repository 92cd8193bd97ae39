//! The order of activations at one instant, and algebraic loops.
//!
//! Only zero-delay links between sampled participants bind activations of one instant to each other: a continuous output
//! stamped t was computed one period earlier, and a delayed sample earlier still. A circle of such links is a loop exactly
//! when there is an instant at which all of its members are activated; otherwise one of them reads an older sample and the
//! circle is open.

use super::components::strongly_connected;
use super::{Plan, PlanError};
use crate::participant::Kind;
use crate::time::SampleTime;

/// An edge: participant `to` at t may need what `from` computes at t, over link `link`.
#[derive(Debug, Clone, Copy)]
struct Edge {
    from: usize,
    to: usize,
    link: usize,
}

const CIRCLES_MAX: usize = 200_000;

/// The links that can bind activations of one instant.
fn instant_edges(plan: &Plan) -> Vec<Edge> {
    let sampled = |participant: usize| plan.participants[participant].interface.kind == Kind::Sampled;
    plan.links
        .iter()
        .enumerate()
        .filter(|(_, link)| sampled(link.from.0) && link.visibility.delay_bounds().0 == 0)
        .map(|(number, link)| Edge {
            from: link.from.0,
            to: link.to.0,
            link: number,
        })
        .collect()
}

/// Gives every participant its rank, or names the algebraic loops.
///
/// Where a circle is open because its members never meet, no rank can satisfy all of its links, and none needs to: those
/// activations are ordered by time. Ranks then follow the remaining links.
pub(super) fn rank(plan: &mut Plan) -> Vec<PlanError> {
    let edges = instant_edges(plan);
    let arrows: Vec<_> = edges.iter().map(|edge| (edge.from, edge.to)).collect();
    let components = strongly_connected(plan.participants.len(), &arrows);
    let mut errors = Vec::new();
    for component in &components {
        errors.extend(loops_in(plan, component, &edges));
    }
    if errors.is_empty() {
        // Components come out of Tarjan's algorithm in reverse topological order. Inside an open circle, an activation
        // never shares an instant with all the others, but some may meet: order those by a local search.
        let mut rank = 0;
        for component in components.iter().rev() {
            for &member in &ordered(plan, component, &edges) {
                plan.participants[member].rank = rank;
                rank += 1;
            }
        }
    }
    errors
}

/// The members of a component in an order that serves every pair that ever meets at one instant, where one exists.
fn ordered(plan: &Plan, component: &[usize], edges: &[Edge]) -> Vec<usize> {
    let mut rest: Vec<usize> = component.to_vec();
    rest.sort_unstable();
    let mut order = Vec::with_capacity(rest.len());
    while !rest.is_empty() {
        let free = rest.iter().position(|&member| {
            !edges.iter().any(|edge| {
                edge.to == member && edge.from != member && rest.contains(&edge.from) && {
                    let (a, b) = (&plan.participants[edge.from], &plan.participants[member]);
                    a.sample_time
                        .meet(&b.sample_time)
                        .is_some_and(|both| both.offset < plan.end)
                }
            })
        });
        order.push(rest.remove(free.unwrap_or(0)));
    }
    order
}

/// Every circle in a component whose members have an instant in common.
fn loops_in(plan: &Plan, component: &[usize], edges: &[Edge]) -> Option<PlanError> {
    let inside = |edge: &&Edge| component.contains(&edge.from) && component.contains(&edge.to);
    let edges: Vec<Edge> = edges.iter().filter(inside).copied().collect();
    let mut search = Search {
        plan,
        edges: &edges,
        path: Vec::new(),
        steps: 0,
    };
    for &start in component {
        let all = plan.participants[start].sample_time;
        match search.from(start, start, all) {
            Ok(()) => {}
            Err(error) => return Some(error),
        }
    }
    None
}

struct Search<'a> {
    plan: &'a Plan,
    edges: &'a [Edge],
    path: Vec<Edge>,
    steps: usize,
}

impl Search<'_> {
    /// Follows edges from `at`, carrying the instants that the path's members share; members below `start` have been
    /// starting points already.
    fn from(&mut self, start: usize, at: usize, shared: SampleTime) -> Result<(), PlanError> {
        for edge in self.edges.iter().filter(|edge| edge.from == at && edge.to >= start) {
            self.steps += 1;
            if self.steps > CIRCLES_MAX {
                return Err(PlanError::TooManyCircles);
            }
            if edge.to == start {
                self.path.push(*edge);
                return Err(self.describe(shared));
            }
            if self.path.iter().any(|passed| passed.to == edge.to) {
                continue;
            }
            let Some(shared) = shared.meet(&self.plan.participants[edge.to].sample_time) else {
                continue;
            };
            if shared.offset < self.plan.end {
                self.path.push(*edge);
                self.from(start, edge.to, shared)?;
                self.path.pop();
            }
        }
        Ok(())
    }

    fn describe(&self, shared: SampleTime) -> PlanError {
        let name = |participant: usize| self.plan.participants[participant].name.as_str();
        let mut members = vec![name(self.path[0].from)];
        members.extend(self.path.iter().map(|edge| name(edge.to)));
        let links: Vec<_> = self
            .path
            .iter()
            .map(|edge| format!("`{}`", self.plan.links[edge.link].name))
            .collect();
        let t = self.plan.timebase.time(shared.offset).map_or_else(
            || format!("{} s", self.plan.timebase.seconds(shared.offset)),
            |time| time.to_string(),
        );
        PlanError::AlgebraicLoop {
            t,
            members: members.join(" -> "),
            links: links.join(", "),
        }
    }
}
