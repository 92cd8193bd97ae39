//! Structural reduction: removal of states that do not affect the transfer matrix.

use crate::linalg::Matrix;
use crate::state_space::StateSpace;

/// The same transfer matrix without the states that no input reaches or that reach no output, found by following
/// nonzero entries of A, B and C. Exact, because only zeros are dropped. This removes weights that a channel does not
/// use, and the Hamiltonian of that channel shrinks by twice their order.
pub fn without_unconnected_states(g: &StateSpace) -> StateSpace {
    let n = g.states();
    let reached = reachable_states(
        n,
        |i| (0..g.inputs()).any(|j| g.b[(i, j)] != 0.0),
        |from, to| g.a[(to, from)] != 0.0,
    );
    let observed = reachable_states(
        n,
        |i| (0..g.outputs()).any(|j| g.c[(j, i)] != 0.0),
        |from, to| g.a[(from, to)] != 0.0,
    );
    let keep: Vec<usize> = (0..n).filter(|&i| reached[i] && observed[i]).collect();
    if keep.len() == n {
        return g.clone();
    }
    let k = keep.len();
    StateSpace {
        a: Matrix::from_fn(k, k, |i, j| g.a[(keep[i], keep[j])]),
        b: Matrix::from_fn(k, g.inputs(), |i, j| g.b[(keep[i], j)]),
        c: Matrix::from_fn(g.outputs(), k, |i, j| g.c[(i, keep[j])]),
        d: g.d.clone(),
    }
}

fn reachable_states(n: usize, seed: impl Fn(usize) -> bool, edge: impl Fn(usize, usize) -> bool) -> Vec<bool> {
    let mut marked: Vec<bool> = (0..n).map(seed).collect();
    let mut queue: Vec<usize> = (0..n).filter(|&i| marked[i]).collect();
    while let Some(from) = queue.pop() {
        for (to, mark) in marked.iter_mut().enumerate() {
            if !*mark && edge(from, to) {
                *mark = true;
                queue.push(to);
            }
        }
    }
    marked
}
