//! A property that needs all states: whether runs without faults end.

use super::graph::Graph;

/// The end of a run without faults.
pub(super) const END: u32 = u32::MAX;

/// The steps that an exploration keeps for it.
#[derive(Debug, Default)]
pub(super) struct KeptSteps {
    /// For each state the next one of the run without faults and the ticks to it: [`END`] where it is over, the state itself
    /// where nothing happens.
    pub(super) fault_free_steps: Vec<(u32, u32)>,
}

impl KeptSteps {
    /// Checks that every run without faults ends, and measures the longest one.
    pub(super) fn judge<A>(&self, graph: &mut Graph<A>) {
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
}
