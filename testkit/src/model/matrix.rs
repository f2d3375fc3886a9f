//! A machine as a table: its reaction in each state to each input.

use core::fmt::Debug;
use core::time::Duration;

use robot_session::end::{Expiry, Input as _, Machine};

/// The time of the table.
pub const NOW: Duration = Duration::from_secs(1);

/// The states and inputs of a machine that stand for all others.
pub trait Rows {
    /// The machine.
    type Machine: Machine<Action: PartialEq>;

    /// Returns at least one state for each row, at [`NOW`].
    fn states() -> Vec<Self::Machine>;

    /// Returns at least one input for each column.
    fn inputs() -> Vec<<Self::Machine as Machine>::Input>;

    /// Returns the configuration of the machine.
    fn config() -> <Self::Machine as Machine>::Config;

    /// Returns the row of a state: its name, and the deadlines that have come, if that makes a difference.
    fn row(machine: &Self::Machine, _now: Duration) -> String {
        machine.name().into()
    }

    /// Returns the column of an input.
    fn column(input: &<Self::Machine as Machine>::Input) -> String {
        input.name().into()
    }

    /// Returns the column of an input if the state or the time decides it; empty if the table has no such column.
    fn column_at(
        _machine: &Self::Machine,
        _now: Duration,
        input: &<Self::Machine as Machine>::Input,
    ) -> String {
        Self::column(input)
    }
}

/// The reaction of a machine in a state to an input. Without `to`, the input is not expected.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cell {
    /// [`Machine::END`].
    pub end: &'static str,
    /// The state's row.
    pub state: String,
    /// The input's column.
    pub input: String,
    /// The row of the next state.
    pub to: Option<String>,
    /// The action; empty if there is nothing to do.
    pub action: String,
}

/// Returns every cell. A timeout is applied to the states in which it has an effect; if time comes first, only the timeout
/// is.
///
/// # Panics
/// If an input that is not expected changes the state, or the error has another name of the input or the state.
pub fn cells<R: Rows>() -> Vec<Cell> {
    let (config, mut cells) = (R::config(), Vec::new());
    for state in R::states() {
        let (row, expires) = (R::row(&state, NOW), state.expires(NOW));
        for input in R::inputs() {
            let (column, is_timeout) = (R::column_at(&state, NOW, &input), is_timeout::<R::Machine>(&input));
            if column.is_empty()
                || (is_timeout != expires && (is_timeout || R::Machine::EXPIRY == Expiry::First))
            {
                continue;
            }
            let (mut next, name) = (state.clone(), input.name());
            let (to, action) = match next.on(NOW, input, &config) {
                Ok(action) => (Some(R::row(&next, NOW)), show(&action)),
                Err(unexpected) => {
                    assert_eq!(next, state, "{row}: {column} is not expected");
                    assert_eq!((unexpected.state, unexpected.input), (state.name(), name));
                    (None, String::new())
                }
            };
            let cell = Cell { end: R::Machine::END, state: row.clone(), input: column, to, action };
            // Of states that differ in their times alone.
            if !cells.contains(&cell) {
                cells.push(cell);
            }
        }
    }
    cells
}

/// Checks that a machine treats its times as [`Machine`] requires.
///
/// # Panics
/// If it does not.
pub fn check_times<R: Rows>() {
    let config = R::config();
    for state in R::states() {
        let row = R::row(&state, NOW);
        let is_over = state.deadline().is_some_and(|at| at <= NOW);
        let sends = |now| state.transmit(now, &config).is_some();
        let is_due = state.expires(NOW) || sends(NOW);
        // A message that is sent at once has no deadline.
        let has_come_due = state.expires(NOW) || sends(NOW) && !sends(Duration::ZERO);
        assert!(is_over || !has_come_due, "{row}: something is due before the deadline");
        assert!(is_due || !is_over, "{row}: nothing is due at the deadline");
        // Each timeout does one thing, and so they come to an end.
        let mut expired = state.clone();
        for round in 0.. {
            assert!(round < 100, "{row}: a timeout is due again and again");
            if !expired.expires(NOW) {
                break;
            }
            assert!(expired.on(NOW, Input::<R>::TIMEOUT, &config).is_ok(), "{row}: a timeout is expected");
        }
        if let Ok(action) = expired.on(NOW, Input::<R>::TIMEOUT, &config) {
            assert_eq!(show(&action), "", "{row}: a timeout that is not due does nothing");
        }
        let mut never = state.clone();
        never.each_time(|time| *time = Duration::MAX);
        let text = format!("{never:?}");
        assert!(!text.contains("999ms") && !text.contains("1.0"), "{row}: a time is not visited: {text}");
        assert_eq!(never.deadline(), None, "{row}: Duration::MAX is never");
        assert!(!never.expires(Duration::MAX), "{row}: Duration::MAX is never");
        let mut again = never.clone();
        again.each_time(|time| assert_eq!(*time, Duration::MAX));
        assert_eq!(again, never, "{row}: a visit changes nothing");
    }
}

type Input<R> = <<R as Rows>::Machine as Machine>::Input;

fn is_timeout<M: Machine>(input: &M::Input) -> bool {
    input.name() == M::Input::TIMEOUT.name()
}

/// Returns the name of an action in a table or a diagram.
fn show(action: &impl Debug) -> String {
    let text = format!("{action:?}");
    if text == "Nothing" { String::new() } else { text }
}
