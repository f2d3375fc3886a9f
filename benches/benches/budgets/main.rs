//! `cargo bench -p benches --bench budgets [-- [LINK] [--check] [--write]]`: instruction counts and timing budgets with
//! their goals. `--write` writes the counts to `benches/results/budgets.json`, from which `cargo run -p reference -- write`
//! fills the tables of the pages.

#[path = "../links/mod.rs"]
mod links;

fn main() -> std::process::ExitCode {
    benches::main("budgets", links::LINKS)
}
