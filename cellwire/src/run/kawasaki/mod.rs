//! Orders for a Kawasaki robot, for a person to run: every job once, with the outcome of each in a journal.

mod jobs;
mod journal;
mod order;
mod run;
mod settings;

pub use jobs::Jobs;
pub use journal::Journal;
pub use run::{RunEnd, Runner};
pub use settings::Settings;
