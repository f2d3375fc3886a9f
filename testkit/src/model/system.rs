//! A system to explore.

use core::{fmt::Debug, hash::Hash};

use super::machine::Edge;

/// A closed system: a machine and its peer, the messages in flight between them, the remaining acts of users and faults, and
/// the known state of every job.
pub trait System: Send + Sync + 'static {
    /// The basis of all decisions about the next act, with times relative to now.
    type State: Clone + Eq + Hash + Debug + Send + Sync;
    /// One thing that happens.
    type Act: Copy + PartialEq + Debug + Send + Sync;

    /// Returns the initial state.
    fn init(&self) -> Self::State;

    /// Pushes everything that can happen in a state.
    fn acts(&self, state: &Self::State, acts: &mut Vec<Self::Act>);

    /// Returns the state after one of [`acts`](Self::acts). Appends the machines' transitions to `edges`, if given.
    fn step(&self, state: &Self::State, act: Self::Act, edges: Option<&mut Vec<Edge>>) -> Self::State;

    /// Pushes the properties that do not hold in a state, each named as what should hold.
    fn broken(&self, state: &Self::State, broken: &mut Vec<&'static str>);

    /// Returns the next of [`acts`](Self::acts) if nothing goes wrong from here on and users are patient. `None` if
    /// nothing happens: a standstill, if it [is not over](Self::is_over).
    fn fault_free_step(&self, state: &Self::State) -> Option<Self::Act>;

    /// Returns whether all work has ended. A run without faults must lead here from every state.
    fn is_over(&self, state: &Self::State) -> bool;

    /// Returns the ticks that an act takes.
    fn ticks(&self, act: Self::Act) -> u32;
}

/// Returns the acts, each row after the ticks before it: `0: Start, Send; 3: Answer; 5.`
pub fn trace<S: System>(system: &S, path: &[S::Act]) -> String {
    let (mut rows, mut now) = (Vec::<(u32, Vec<String>)>::new(), 0);
    for act in path {
        match (system.ticks(*act), rows.last_mut()) {
            (0, Some((at, acts))) if *at == now => acts.push(format!("{act:?}")),
            (0, _) => rows.push((now, vec![format!("{act:?}")])),
            (ticks, _) => now += ticks,
        }
    }
    let rows: Vec<String> = rows.iter().map(|(at, acts)| format!("{at}: {}", acts.join(", "))).collect();
    format!("{}; {now}.", rows.join("; "))
}
