//! The results of an exploration.

use std::collections::BTreeMap;

use super::machine::Edge;

/// The property that breaks in a state where nothing can happen and that is not over.
pub const DEADLOCK: &str = "no deadlock";
/// The property that breaks in a state from which a run without faults never comes to the end of all work.
pub const STANDSTILL: &str = "no standstill: a run without faults ends all work";

/// Every state by its number, in the order of breadth first: the first is where it begins, and each has the step that led there
/// first, so that every path is a shortest one.
#[derive(Debug, Clone)]
pub struct Graph<A> {
    /// The number of visited states.
    pub states: usize,
    /// The number of steps from one state to another.
    pub steps: usize,
    /// Whether these are all states.
    pub complete: bool,
    /// The properties that do not always hold, and the first state where each does not.
    pub broken: BTreeMap<&'static str, u32>,
    /// The first state where nothing can happen and that is not over.
    pub deadlock: Option<u32>,
    /// The first state from which a run without faults never comes to the end of all work.
    pub standstill: Option<u32>,
    /// The longest run without faults to the end of all work, in ticks, and where it begins.
    pub longest_benign: (u32, u32),
    /// Every transition that the machines took, and the first state and act with it. Collected on demand.
    pub edges: BTreeMap<Edge, (u32, A)>,
    /// The state before, and the act that led from it, for every state but the first.
    pub(super) parents: Vec<(u32, A)>,
}

/// A property that does not hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Finding {
    /// The name of the property.
    pub property: &'static str,
    /// The first state where it does not hold.
    pub at: u32,
}

impl<A: Copy> Graph<A> {
    pub(super) fn new() -> Self {
        Self {
            states: 0,
            steps: 0,
            complete: true,
            broken: BTreeMap::new(),
            deadlock: None,
            standstill: None,
            longest_benign: (0, 0),
            edges: BTreeMap::new(),
            parents: Vec::new(),
        }
    }

    /// Returns a shortest path from the first state.
    pub fn path(&self, mut at: u32) -> Vec<A> {
        let mut path = Vec::new();
        while let Some((from, act)) = at.checked_sub(1).map(|parent| self.parents[parent as usize]) {
            path.push(act);
            at = from;
        }
        path.reverse();
        path
    }

    /// Returns every property that is broken, the one with the shortest path first.
    pub fn findings(&self) -> Vec<Finding> {
        let broken = self.broken.iter().map(|(property, at)| (*property, Some(*at)));
        let runs = [(DEADLOCK, self.deadlock), (STANDSTILL, self.standstill)];
        let all = broken.chain(runs).filter_map(|(property, at)| Some(Finding { property, at: at? }));
        let mut all: Vec<_> = all.collect();
        all.sort_by_key(|finding| finding.at);
        all
    }

    /// Returns whether every state was visited and every property holds.
    pub fn holds(&self) -> bool {
        self.complete && self.findings().is_empty()
    }

    /// Paths that together visit every state and, if they were collected, take every transition: a path to each leaf of the
    /// search tree, since every state is on one of them, and for each transition a path to it and the act that takes it.
    pub fn walks(&self) -> impl Iterator<Item = Vec<A>> + '_ {
        let mut leaves = vec![true; self.states];
        self.parents.iter().for_each(|(from, _)| leaves[*from as usize] = false);
        let leaves = (0..self.states).filter(move |at| leaves[*at]).map(|at| self.path(at as u32));
        let edges = self.edges.values().map(|(at, act)| {
            let mut path = self.path(*at);
            path.push(*act);
            path
        });
        leaves.chain(edges)
    }
}
