//! Properties that need all states: whether runs without faults end, and how long the system can stall.

use std::collections::HashMap;

use super::graph::Graph;

/// The end of a run without faults.
pub(super) const END: u32 = u32::MAX;

/// The steps that an exploration keeps for it.
#[derive(Debug, Default)]
pub(super) struct KeptSteps {
    /// For each state the next one of the run without faults and the ticks to it: [`END`] where it is over, the state itself
    /// where nothing happens.
    pub(super) fault_free_steps: Vec<(u32, u32)>,
    /// The steps between stalled states, and their ticks.
    pub(super) standing: Vec<(u32, u32, u32)>,
}

impl KeptSteps {
    pub(super) fn judge<A>(&self, graph: &mut Graph<A>) {
        self.follow_benign(graph);
        self.longest_standing(graph);
    }

    /// Checks that every run without faults ends, and measures the longest one.
    fn follow_benign<A>(&self, graph: &mut Graph<A>) {
        const UNKNOWN: u32 = u32::MAX;
        const OPEN: u32 = u32::MAX - 1;
        let mut ticks = vec![UNKNOWN; self.fault_free_steps.len()];
        let mut path = Vec::new();
        for start in 0..self.fault_free_steps.len() {
            let mut at = start;
            let mut left = loop {
                match ticks[at] {
                    UNKNOWN => {}
                    // The run has come back to where it was.
                    OPEN => {
                        graph.standstill.get_or_insert(start as u32);
                        break 0;
                    }
                    known => break known,
                }
                ticks[at] = OPEN;
                path.push(at);
                match self.fault_free_steps[at].0 {
                    END => break 0,
                    to => at = to as usize,
                }
            };
            while let Some(at) = path.pop() {
                let (to, takes) = self.fault_free_steps[at];
                left += if to == END { 0 } else { takes };
                ticks[at] = left;
                if left > graph.longest_benign.0 {
                    graph.longest_benign = (left, at as u32);
                }
            }
        }
    }

    /// Measures the longest path in ticks between stalled states; endless if a cycle takes time. A cycle without time counts
    /// as one state.
    fn longest_standing<A>(&self, graph: &mut Graph<A>) {
        let mut numbers: HashMap<u32, usize> = HashMap::new();
        let mut states: Vec<u32> = Vec::new();
        let mut number = |state: u32| {
            *numbers.entry(state).or_insert_with(|| {
                states.push(state);
                states.len() - 1
            })
        };
        let steps = self.standing.iter().map(|(from, to, ticks)| (number(*from), number(*to), *ticks));
        let steps: Vec<(usize, usize, u32)> = steps.collect();
        let mut out: Vec<Vec<(usize, u32)>> = vec![Vec::new(); states.len()];
        for (from, to, ticks) in &steps {
            out[*from].push((*to, *ticks));
        }
        let component = components(&out);
        let for_ever =
            steps.iter().find(|(from, to, ticks)| *ticks > 0 && component[*from] == component[*to]);
        if let Some((from, ..)) = for_ever {
            graph.longest_standing = None;
            graph.stands_for_ever = Some(states[*from]);
            return;
        }
        // Components are numbered from the ends: the successors of a state have smaller numbers.
        let mut order: Vec<usize> = (0..states.len()).collect();
        order.sort_by_key(|at| component[*at]);
        let mut longest = vec![0; states.len()];
        for at in order {
            let onwards = out[at].iter().filter(|(to, _)| component[*to] != component[at]);
            let best = onwards.map(|(to, ticks)| longest[component[*to]] + ticks).max().unwrap_or(0);
            longest[component[at]] = longest[component[at]].max(best);
        }
        let most = (0..states.len()).max_by_key(|at| longest[component[*at]]);
        graph.longest_standing = Some(most.map_or((0, 0), |at| (longest[component[at]], states[at])));
    }
}

/// Computes Tarjan's strongly connected components, without recursion.
fn components(out: &[Vec<(usize, u32)>]) -> Vec<usize> {
    const NEW: usize = usize::MAX;
    let (mut index, mut low, mut component) =
        (vec![NEW; out.len()], vec![0; out.len()], vec![NEW; out.len()]);
    let (mut stack, mut calls, mut next, mut count) = (Vec::new(), Vec::new(), 0, 0);
    for root in 0..out.len() {
        if index[root] != NEW {
            continue;
        }
        calls.push((root, 0));
        while let Some((at, mut edge)) = calls.pop() {
            if edge == 0 {
                (index[at], low[at]) = (next, next);
                next += 1;
                stack.push(at);
            } else {
                low[at] = low[at].min(low[out[at][edge - 1].0]);
            }
            let deeper = loop {
                let Some((to, _)) = out[at].get(edge) else { break None };
                edge += 1;
                if index[*to] == NEW {
                    break Some(*to);
                }
                if component[*to] == NEW {
                    low[at] = low[at].min(index[*to]);
                }
            };
            if let Some(to) = deeper {
                calls.push((at, edge));
                calls.push((to, 0));
            } else if low[at] == index[at] {
                while let Some(member) = stack.pop() {
                    component[member] = count;
                    if member == at {
                        break;
                    }
                }
                count += 1;
            }
        }
    }
    component
}
