//! `cargo bench -p benches --bench peers [-- NAME]`: races against other crates that do the same work. One file per subject.
//!
//! Times are compared as ratios within one run: contenders take turns in a rotating order, and the medians are compared.

mod modbus;
mod queue;
mod race;
mod stuffing;
mod text;

fn main() {
    let filter = std::env::args().skip(1).find(|argument| !argument.starts_with("--")).unwrap_or_default();
    let subjects: [(&str, fn()); 4] = [
        ("queue", queue::race),
        ("modbus", modbus::races),
        ("stuffing", stuffing::races),
        ("text", text::races),
    ];
    let chosen: Vec<_> = subjects.iter().filter(|(name, _)| name.contains(&filter)).collect();
    if chosen.is_empty() {
        eprintln!("no race is called {filter:?}; there are {:?}", subjects.map(|(name, _)| name));
        std::process::exit(2);
    }
    for (_, race) in chosen {
        race();
    }
}
