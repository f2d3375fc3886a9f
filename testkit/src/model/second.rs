//! A second opinion: any system as a model of `stateright`.
//!
//! The second search shares only the system with the project's own. Its traces are not the shortest, and its liveness misses
//! cycles: it is used to count.

use std::sync::Arc;

use stateright::{Checker as _, Model, Property};

use super::system::System;

/// Returns the number of states, and of the steps between them.
pub(super) fn count(system: Arc<impl System>) -> (usize, usize) {
    let checker = Second(system).checker().spawn_bfs().join();
    // The checker counts the first state as a step.
    (checker.unique_state_count(), checker.state_count() - 1)
}

struct Second<S>(Arc<S>);

impl<S: System> Model for Second<S> {
    type State = S::State;
    type Action = S::Act;

    fn init_states(&self) -> Vec<S::State> {
        vec![self.0.init()]
    }

    fn actions(&self, state: &S::State, acts: &mut Vec<S::Act>) {
        let mut broken = Vec::new();
        self.0.broken(state, &mut broken);
        if broken.is_empty() {
            self.0.acts(state, acts);
        }
    }

    fn next_state(&self, state: &S::State, act: S::Act) -> Option<S::State> {
        Some(self.0.step(state, act, None))
    }

    /// Returns a property that stays undecided up to the last state: the checker stops when all properties are
    /// decided.
    fn properties(&self) -> Vec<Property<Self>> {
        vec![Property::always("goes on to the last state", |_, _| true)]
    }
}
