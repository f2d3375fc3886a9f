//! The properties of a machine that the model and the diagrams need.

use core::time::Duration;

use robot_session::Unexpected;
use robot_session::end::{Input as _, Machine};

/// A machine that the model explores, and draws.
pub trait DrawnMachine: Machine {
    /// Returns the name of an action in a diagram, which distinguishes transitions; empty if there is nothing to do.
    fn action_name(action: &Self::Action) -> String {
        let text = format!("{action:?}");
        text.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().into()
    }
}

/// One transition of one end.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Edge {
    /// [`Machine::END`].
    pub end: &'static str,
    /// The state's name.
    pub from: &'static str,
    /// The input's name.
    pub input: &'static str,
    /// The next state's name.
    pub to: &'static str,
    /// The action's name.
    pub action: String,
}

/// The list to which a step appends its transitions, if they are collected.
pub type Edges<'a> = Option<&'a mut Vec<Edge>>;

/// Moves a machine at the model's time, which is always zero, and notes the transition.
///
/// # Errors
/// The machine's: whether it may come is a property of the system.
pub fn drive<M: DrawnMachine>(
    machine: &mut M,
    input: M::Input,
    config: &M::Config,
    edges: &mut Edges<'_>,
) -> Result<M::Action, Unexpected> {
    let (from, name) = (machine.name(), input.name());
    let action = machine.on(Duration::ZERO, input, config)?;
    if let Some(edges) = edges {
        edges.push(Edge {
            end: M::END,
            from,
            input: name,
            to: machine.name(),
            action: M::action_name(&action),
        });
    }
    Ok(action)
}

/// Lets time pass. An expired deadline is zero: it must not matter how long ago it expired, so that the states are
/// finitely many. `Duration::MAX` means never, and stays unchanged.
pub fn age<M: Machine>(machine: &mut M, by: Duration) {
    machine.each_time(|time| {
        if *time != Duration::MAX {
            *time = time.saturating_sub(by);
        }
    });
}
