//! The clients that run a piece of work on a machine, each part of it once; its operator, and what they type.

pub mod kawasaki;
pub mod laser;
pub mod mma;

use std::sync::mpsc::Receiver;

use anyhow::Result;
use serde::Serialize;
use serde_json::Value;

/// Who is told, and asked.
#[allow(missing_debug_implementations, reason = "it holds what notifies")]
pub struct Operator<'a> {
    /// The lines that the operator types; it may end.
    pub words: Receiver<String>,
    /// What happens, as objects.
    pub notify: &'a mut dyn FnMut(Value) -> Result<()>,
    /// How much of the work is done.
    pub progress: &'a mut dyn FnMut(usize),
}

/// A word on standard input.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Word {
    /// Begin nothing new until `continue`.
    Pause,
    /// Go on.
    Continue,
    /// End after what is under way.
    Stop,
    /// Stop everything now.
    Abort,
    /// To a question: it was done, go on after it.
    Done,
    /// To a question: it was not done, do it again.
    Repeat,
}

impl Word {
    /// The words, for a hint.
    pub const HINT: &str = "type pause, continue or stop; answer questions with done, repeat or stop";

    /// The word that a line is, also by its first letter.
    pub fn parse(line: &str) -> Option<Self> {
        Some(match line.trim() {
            "pause" | "p" => Self::Pause,
            "continue" | "c" => Self::Continue,
            "stop" | "s" => Self::Stop,
            "abort" | "a" => Self::Abort,
            "done" | "d" => Self::Done,
            "repeat" | "r" => Self::Repeat,
            _ => return None,
        })
    }
}
