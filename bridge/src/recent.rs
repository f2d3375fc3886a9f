//! The latest commands, for the page.

use std::collections::VecDeque;

use serde::Serialize;

use super::report::Outcome;

/// The number of commands that are shown.
const MAX_COMMANDS: usize = 30;
/// The number of bytes of an id or a reason that are shown.
const MAX_TEXT_LEN: usize = 200;

/// The latest commands.
#[derive(Debug, Default)]
pub struct Commands(VecDeque<RecentCommand>);

/// A command.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RecentCommand {
    /// The name of the cell.
    pub cell: String,
    /// The id of the command.
    pub id: String,
    /// The time at which the command arrived, in milliseconds since 1970 UTC.
    pub at: u64,
    /// The outcome of the command.
    pub outcome: Outcome,
    /// The reason for the outcome; empty without one.
    pub detail: String,
}

impl Commands {
    /// Notes the outcome that a command has now.
    pub fn note(&mut self, cell: &str, id: &str, at: u64, outcome: Outcome, detail: &str) {
        let (id, detail) = (cut(id), cut(detail));
        if let Some(known) = self.0.iter_mut().find(|known| known.cell == cell && known.id == id) {
            (known.outcome, known.detail) = (outcome, detail);
            return;
        }
        self.0.push_front(RecentCommand { cell: cell.into(), id, at, outcome, detail });
        if self.0.len() > MAX_COMMANDS {
            // Remove the oldest command that is not under way.
            let over = self.0.iter().rposition(|known| known.outcome != Outcome::Accepted);
            self.0.remove(over.unwrap_or(MAX_COMMANDS));
        }
    }

    /// Returns the commands, the latest first.
    pub fn list(&self) -> Vec<RecentCommand> {
        self.0.iter().cloned().collect()
    }
}

fn cut(text: &str) -> String {
    if text.len() <= MAX_TEXT_LEN {
        return text.into();
    }
    let end = text.char_indices().map(|(at, _)| at).take_while(|at| *at <= MAX_TEXT_LEN).last();
    format!("{}…", text.get(..end.unwrap_or_default()).unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn those_under_way_stay_and_the_latest_are_first() {
        let mut commands = Commands::default();
        commands.note("a", "slow", 1, Outcome::Accepted, "");
        for number in 0..40 {
            commands.note("a", &number.to_string(), 2, Outcome::Refused, &"é".repeat(150));
        }
        let list = commands.list();
        assert_eq!(
            (list.len(), list[0].id.as_str(), list[0].detail.len()),
            (MAX_COMMANDS, "39", 200 + "…".len())
        );
        assert_eq!((list[MAX_COMMANDS - 1].id.as_str(), list[MAX_COMMANDS - 2].id.as_str()), ("slow", "11"));
        commands.note("a", "slow", 9, Outcome::Done, "");
        let last = commands.list().pop().unwrap();
        assert_eq!((last.at, last.outcome), (1, Outcome::Done));
    }
}
