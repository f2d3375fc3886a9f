//! The real sessions of a link, driven over bytes along the paths of its model.

use super::explore::{Options, explore};
use super::system::System;

/// The extent of a walk.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Refined {
    /// States of the model.
    pub states: usize,
    /// Transitions of its machines.
    pub transitions: usize,
    /// Paths through them.
    pub walks: usize,
    /// Steps of all paths.
    pub steps: usize,
}

impl Refined {
    /// Walks every state and every transition of a system in which every property holds.
    ///
    /// # Panics
    /// If a property does not hold.
    pub fn by<S: System>(system: &S, mut walk: impl FnMut(Vec<S::Act>)) -> Self {
        let graph = explore(system, &Options { edges: true, ..Options::default() });
        assert!(graph.holds(), "{:?}", graph.findings());
        let mut refined = Self { states: graph.states, transitions: graph.edges.len(), ..Self::default() };
        for path in graph.walks() {
            refined.walks += 1;
            refined.steps += path.len();
            walk(path);
        }
        refined
    }
}

/// Walks every state and every transition of a system with sessions that are `new` for each path. `walk` applies an act to
/// them, given the states before and after it and the path to it; `compare` panics if they differ from a state.
pub fn refine<S: System, R>(
    system: &S,
    new: impl Fn() -> R,
    walk: impl Fn(&mut R, S::Act, &S::State, &S::State, &[S::Act]),
    compare: impl Fn(&mut R, &S::State, &[S::Act]),
) -> Refined {
    Refined::by(system, |path| {
        let (mut sessions, mut state) = (new(), system.init());
        compare(&mut sessions, &state, &[]);
        for (at, act) in path.iter().enumerate() {
            let next = system.step(&state, *act, None);
            walk(&mut sessions, *act, &state, &next, &path[..=at]);
            compare(&mut sessions, &next, &path[..=at]);
            state = next;
        }
    })
}
