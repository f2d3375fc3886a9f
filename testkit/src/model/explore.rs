//! Every state of a system, breadth first.

use core::hash::BuildHasherDefault;
use core::sync::atomic::{AtomicU64, Ordering};
use std::collections::{HashMap, VecDeque};

use super::fingerprint::{Identity, fingerprint};
use super::graph::Graph;
use super::runs::{END, KeptSteps};
use super::system::System;

/// The bounds and the results of an exploration.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a> {
    /// The most states: of a system that has more, not all are visited.
    pub limit: usize,
    /// Whether to collect the machines' transitions.
    pub edges: bool,
    /// Stops where this property breaks first.
    pub until: Option<&'static str>,
    /// Counts the visited states, as a progress report.
    pub progress: Option<&'a AtomicU64>,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self { limit: 100_000_000, edges: false, until: None, progress: None }
    }
}

/// Visits every state once. Of each, only a fingerprint, the step that led to it first and the next one without faults are
/// kept: some 50 bytes, whatever its size. A state that breaks a property is not left.
pub fn explore<S: System>(system: &S, options: &Options<'_>) -> Graph<S::Act> {
    search::<S, Fingerprints>(system, options)
}

/// Explores with whole states in place of fingerprints, for a test that compares the counts.
pub fn explore_whole<S: System>(system: &S, options: &Options<'_>) -> Graph<S::Act> {
    search::<S, HashMap<S::State, u32>>(system, options)
}

type Fingerprints = HashMap<u128, u32, BuildHasherDefault<Identity>>;

/// The states that are known, and their numbers.
trait KnownStates<T>: Default {
    /// Returns the number of a state, which is `fresh` if the state was unknown.
    fn number(&mut self, state: &T, fresh: u32) -> u32;
}

impl<T: core::hash::Hash> KnownStates<T> for Fingerprints {
    fn number(&mut self, state: &T, fresh: u32) -> u32 {
        *self.entry(fingerprint(state)).or_insert(fresh)
    }
}

impl<T: Clone + Eq + core::hash::Hash> KnownStates<T> for HashMap<T, u32> {
    fn number(&mut self, state: &T, fresh: u32) -> u32 {
        if let Some(number) = self.get(state) {
            return *number;
        }
        self.insert(state.clone(), fresh);
        fresh
    }
}

fn search<S: System, K: KnownStates<S::State>>(system: &S, options: &Options<'_>) -> Graph<S::Act> {
    let (mut graph, mut known, mut runs) = (Graph::new(), K::default(), KeptSteps::default());
    let (mut acts, mut broken, mut edges) = (Vec::new(), Vec::new(), Vec::new());
    let first = system.init();
    known.number(&first, 0);
    let mut next = VecDeque::from([first]);
    while let Some(state) = next.pop_front() {
        let at = graph.states as u32;
        if graph.states >= options.limit {
            graph.complete = false;
            break;
        }
        graph.states += 1;
        if let Some(progress) = options.progress {
            progress.fetch_add(1, Ordering::Relaxed);
        }
        system.broken(&state, &mut broken);
        acts.clear();
        if broken.is_empty() {
            system.acts(&state, &mut acts);
        }
        let over = system.is_over(&state);
        let fault_free_step = if over || !broken.is_empty() { None } else { system.fault_free_step(&state) };
        if acts.is_empty() && broken.is_empty() && !over {
            graph.deadlock.get_or_insert(at);
        }
        // A run without faults that does not continue has ended or is stalled.
        let mut follow = (if over || !broken.is_empty() { END } else { at }, 0);
        for name in broken.drain(..) {
            graph.broken.entry(name).or_insert(at);
        }
        for act in acts.iter().copied() {
            let after = system.step(&state, act, options.edges.then_some(&mut edges));
            for edge in edges.drain(..) {
                graph.edges.entry(edge).or_insert((at, act));
            }
            graph.steps += 1;
            let fresh = graph.parents.len() as u32 + 1;
            let to = known.number(&after, fresh);
            if fault_free_step == Some(act) {
                follow = (to, system.ticks(act));
            }
            if to == fresh {
                graph.parents.push((at, act));
                next.push_back(after);
            }
        }
        if let Some(act) = fault_free_step {
            assert!(acts.contains(&act), "{act:?} is benign and cannot happen in {state:?}");
        }
        runs.fault_free_steps.push(follow);
        if options.until.is_some_and(|property| graph.broken.contains_key(property)) {
            graph.complete = false;
            break;
        }
    }
    if graph.complete {
        runs.judge(&mut graph);
    }
    graph
}
