//! The order of activations at one instant, and algebraic loops.
//!
//! Only zero-delay links between sampled participants constrain the order of activations at one instant: a continuous output stamped t
//! was computed one period earlier, and a delayed sample earlier still. A cycle of such links is a loop exactly when there is an instant
//! at which all of its members are activated; otherwise one of them reads an older sample and the cycle is open.

use std::collections::{BTreeSet, HashMap, HashSet};

use super::components::strongly_connected;
use super::{Plan, PlanError};
use crate::participant::Kind;
use crate::time::SampleTime;

/// An edge: participant `to` at t may need the output that `from` computes at t, over link `link`.
#[derive(Debug, Clone, Copy)]
struct Edge {
    from: usize,
    to: usize,
    link: usize,
}

const SEARCH_STEPS_MAX: usize = 200_000;

/// The links that can constrain the order of activations at one instant.
fn instant_edges(plan: &Plan) -> Vec<Edge> {
    let sampled = |participant: usize| plan.participants[participant].interface.kind == Kind::Sampled;
    plan.links
        .iter()
        .enumerate()
        .filter(|(_, link)| sampled(link.from.0) && link.delivery.delay_bounds().0 == 0)
        .map(|(number, link)| Edge {
            from: link.from.0,
            to: link.to.0,
            link: number,
        })
        .collect()
}

/// Assigns every participant its rank, or reports the algebraic loops.
///
/// Where a cycle is open because its members never share an instant, no rank can satisfy all of its links, and none needs to: those
/// activations are ordered by time. Ranks then follow the remaining links.
pub(super) fn rank(plan: &mut Plan) -> Vec<PlanError> {
    let edges = instant_edges(plan);
    let edge_ends: Vec<_> = edges.iter().map(|edge| (edge.from, edge.to)).collect();
    let components = strongly_connected(plan.participants.len(), &edge_ends);
    let edges_by_component = edges_by_component(plan, &components, &edges);
    let mut errors = Vec::new();
    for (component, edges) in components.iter().zip(&edges_by_component) {
        errors.extend(find_algebraic_loop(plan, component, edges));
    }
    if errors.is_empty() {
        // Tarjan's algorithm yields components in reverse topological order. Inside an open cycle, an activation never shares an instant
        // with all the others, but some may share one: order those by a local search.
        let mut rank = 0;
        for (component, edges) in components.iter().zip(&edges_by_component).rev() {
            for member in order_members(plan, component, edges) {
                plan.participants[member].rank = rank;
                rank += 1;
            }
        }
    }
    errors
}

/// The edges inside each component, by their first participant, each list in the order of the links.
fn edges_by_component(plan: &Plan, components: &[Vec<usize>], edges: &[Edge]) -> Vec<HashMap<usize, Vec<Edge>>> {
    let mut component_of = vec![0; plan.participants.len()];
    for (number, component) in components.iter().enumerate() {
        component.iter().for_each(|&member| component_of[member] = number);
    }
    let mut edges_by_component = vec![HashMap::new(); components.len()];
    for edge in edges
        .iter()
        .filter(|edge| component_of[edge.from] == component_of[edge.to])
    {
        let own: &mut HashMap<usize, Vec<Edge>> = &mut edges_by_component[component_of[edge.from]];
        own.entry(edge.from).or_default().push(*edge);
    }
    edges_by_component
}

/// The members of a component in an order that satisfies every pair that ever shares an instant, where such an order exists: of those
/// that wait for no other one, the first.
fn order_members(plan: &Plan, component: &[usize], edges: &HashMap<usize, Vec<Edge>>) -> Vec<usize> {
    let constrains = |edge: &&Edge| {
        let (a, b) = (&plan.participants[edge.from], &plan.participants[edge.to]);
        let both = a.sample_time.intersection(&b.sample_time);
        edge.from != edge.to && both.is_some_and(|both| both.offset < plan.end)
    };
    let mut successors: HashMap<usize, Vec<usize>> = HashMap::new();
    let mut pending_predecessors: HashMap<usize, usize> = HashMap::new();
    for edge in edges.values().flatten().filter(constrains) {
        successors.entry(edge.from).or_default().push(edge.to);
        *pending_predecessors.entry(edge.to).or_default() += 1;
    }
    let mut rest: BTreeSet<usize> = component.iter().copied().collect();
    let mut ready: BTreeSet<usize> = rest
        .iter()
        .filter(|member| !pending_predecessors.contains_key(*member))
        .copied()
        .collect();
    let mut order = Vec::with_capacity(rest.len());
    while let Some(member) = ready.pop_first().or_else(|| rest.first().copied()) {
        rest.remove(&member);
        order.push(member);
        for next in successors.remove(&member).into_iter().flatten() {
            let left = pending_predecessors.entry(next).or_default();
            *left -= 1;
            if *left == 0 && rest.contains(&next) {
                ready.insert(next);
            }
        }
    }
    order
}

/// Returns the first cycle found in a component whose members have an instant in common.
fn find_algebraic_loop(plan: &Plan, component: &[usize], edges: &HashMap<usize, Vec<Edge>>) -> Option<PlanError> {
    let mut search = Search {
        plan,
        edges,
        path: Vec::new(),
        on_path: HashSet::new(),
        steps: 0,
    };
    for &start in component {
        let all = plan.participants[start].sample_time;
        match search.extend_path(start, start, all) {
            Ok(()) => {}
            Err(error) => return Some(error),
        }
    }
    None
}

struct Search<'a> {
    plan: &'a Plan,
    edges: &'a HashMap<usize, Vec<Edge>>,
    path: Vec<Edge>,
    /// The participants that the edges of the path lead to.
    on_path: HashSet<usize>,
    steps: usize,
}

impl Search<'_> {
    /// Follows edges from `at`, carrying the instants that the path's members share; members below `start` have already been used as
    /// starting points.
    fn extend_path(&mut self, start: usize, at: usize, shared: SampleTime) -> Result<(), PlanError> {
        for edge in self
            .edges
            .get(&at)
            .into_iter()
            .flatten()
            .filter(|edge| edge.to >= start)
        {
            self.steps += 1;
            if self.steps > SEARCH_STEPS_MAX {
                return Err(PlanError::TooManyCycles);
            }
            if edge.to == start {
                self.path.push(*edge);
                return Err(self.loop_error(shared));
            }
            if self.on_path.contains(&edge.to) {
                continue;
            }
            let Some(shared) = shared.intersection(&self.plan.participants[edge.to].sample_time) else {
                continue;
            };
            if shared.offset < self.plan.end {
                self.path.push(*edge);
                self.on_path.insert(edge.to);
                self.extend_path(start, edge.to, shared)?;
                self.path.pop();
                self.on_path.remove(&edge.to);
            }
        }
        Ok(())
    }

    fn loop_error(&self, shared: SampleTime) -> PlanError {
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
