//! What every machine is to the model.

use core::{fmt::Debug, hash::Hash, time::Duration};

use robot_session::Unexpected;

/// The machine of one end of a link. Its crate knows nothing of this trait: the adapter implements it, a line a method.
pub trait Machine: Clone + Eq + Hash + Debug {
    /// What the end is called, as its diagram's file is.
    const END: &'static str;
    /// What the session has understood.
    type Input;
    /// What the session is to do.
    type Action: Debug;
    /// The limits and options that the machine works with.
    type Config;

    /// Moves the machine. On `Err` nothing has changed.
    ///
    /// # Errors
    /// An input that the state does not allow.
    fn on(
        &mut self,
        now: Duration,
        input: Self::Input,
        config: &Self::Config,
    ) -> Result<Self::Action, Unexpected>;

    /// Visits every time in the state. Each is a deadline.
    fn each_time(&mut self, f: impl FnMut(&mut Duration));

    /// The state's name.
    fn name(&self) -> &'static str;

    /// The input's name.
    fn input_name(input: &Self::Input) -> &'static str;

    /// What a diagram calls an action, and what tells two transitions apart; empty if there is nothing to do.
    fn action_name(action: &Self::Action) -> String {
        let text = format!("{action:?}");
        text.split(|c: char| !c.is_alphanumeric()).next().unwrap_or_default().into()
    }
}

/// A machine that is one of `robot-session`; with a function, if a diagram is to say more of an action than its first word.
#[cfg(feature = "links")]
macro_rules! adapt {
    ($machine:ty $(, action_name = $action_name:path)?) => {
        impl $crate::model::Machine for $machine {
            const END: &'static str = <Self as robot_session::Machine>::END;
            type Input = <Self as robot_session::Machine>::Input;
            type Action = <Self as robot_session::Machine>::Action;
            type Config = <Self as robot_session::Machine>::Config;

            fn on(
                &mut self,
                now: core::time::Duration,
                input: Self::Input,
                config: &Self::Config,
            ) -> Result<Self::Action, robot_session::Unexpected> {
                robot_session::Machine::on(self, now, input, config)
            }

            fn each_time(&mut self, f: impl FnMut(&mut core::time::Duration)) {
                robot_session::Machine::each_time(self, f);
            }

            fn name(&self) -> &'static str {
                robot_session::Machine::name(self)
            }

            fn input_name(input: &Self::Input) -> &'static str {
                robot_session::Input::name(input)
            }

            $(fn action_name(action: &Self::Action) -> String {
                $action_name(action)
            })?
        }
    };
}
#[cfg(feature = "links")]
pub(crate) use adapt;

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

/// Where a step notes its transitions, if somebody collects them.
pub type Edges<'a> = Option<&'a mut Vec<Edge>>;

/// Moves a machine at the model's time, which is always zero, and notes the transition.
///
/// # Errors
/// The machine's: whether it may come is a property of the system.
pub fn drive<M: Machine>(
    machine: &mut M,
    input: M::Input,
    config: &M::Config,
    edges: &mut Edges<'_>,
) -> Result<M::Action, Unexpected> {
    let (from, name) = (machine.name(), M::input_name(&input));
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

/// Lets time pass. A deadline that has passed is zero: how long ago it was must change nothing, so that the states are finitely
/// many. `Duration::MAX` is never, and stays so.
pub fn age<M: Machine>(machine: &mut M, by: Duration) {
    machine.each_time(|time| {
        if *time != Duration::MAX {
            *time = time.saturating_sub(by);
        }
    });
}
