//! Strongly connected components of a directed graph.

/// Tarjan's strongly connected components, in reverse topological order, without recursion.
pub(super) fn strongly_connected(count: usize, edges: &[(usize, usize)]) -> Vec<Vec<usize>> {
    const UNVISITED: usize = usize::MAX;
    let mut next: Vec<Vec<usize>> = vec![Vec::new(); count];
    for &(from, to) in edges {
        next[from].push(to);
    }
    let (mut index, mut low) = (vec![UNVISITED; count], vec![0; count]);
    let mut on_stack = vec![false; count];
    let (mut stack, mut components, mut counter) = (Vec::new(), Vec::new(), 0);
    for root in 0..count {
        if index[root] != UNVISITED {
            continue;
        }
        let mut work = vec![(root, 0)];
        while let Some((node, position)) = work.pop() {
            if position == 0 {
                (index[node], low[node]) = (counter, counter);
                counter += 1;
                stack.push(node);
                on_stack[node] = true;
            } else {
                low[node] = low[node].min(low[next[node][position - 1]]);
            }
            let mut position = position;
            let descend = loop {
                match next[node].get(position) {
                    None => break None,
                    Some(&child) if index[child] == UNVISITED => break Some(child),
                    Some(&child) => {
                        if on_stack[child] {
                            low[node] = low[node].min(index[child]);
                        }
                        position += 1;
                    }
                }
            };
            if let Some(child) = descend {
                work.push((node, position + 1));
                work.push((child, 0));
            } else if low[node] == index[node] {
                let at = stack
                    .iter()
                    .rposition(|&other| other == node)
                    .expect("a node under work is on the stack");
                let component = stack.split_off(at);
                component.iter().for_each(|&member| on_stack[member] = false);
                components.push(component);
            }
        }
    }
    components
}
