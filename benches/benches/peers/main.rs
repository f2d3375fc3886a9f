//! `cargo bench -p benches --bench peers [-- [NAME] [--check]]`: races against other crates that do the same work. One file per
//! subject.
//!
//! Times are compared as ratios within one run: contenders take turns in a rotating order, and the medians are compared. With
//! `--check` a goal of the queue that is missed is a failure.

mod clients;
mod modbus;
mod queue;
mod race;
mod stuffing;
mod text;

use std::process::ExitCode;

fn main() -> ExitCode {
    let filter = std::env::args().skip(1).find(|argument| !argument.starts_with("--")).unwrap_or_default();
    let subjects = ["queue", "modbus", "clients", "stuffing", "text"];
    let chosen: Vec<_> = subjects.iter().filter(|name| name.contains(&filter)).collect();
    if chosen.is_empty() {
        eprintln!("no race is called {filter:?}; there are {subjects:?}");
        return ExitCode::from(2);
    }
    let mut missed = 0;
    for subject in chosen {
        match *subject {
            "queue" => missed = queue::race(),
            "modbus" => modbus::races(),
            "clients" => clients::races(),
            "stuffing" => stuffing::races(),
            _ => text::races(),
        }
    }
    if missed > 0 && std::env::args().any(|argument| argument == "--check") {
        eprintln!("{missed} goals of the queue are missed");
        return ExitCode::FAILURE;
    }
    ExitCode::SUCCESS
}
