//! `cargo bench -p benches --bench budgets [-- LINK]`: instruction counts and timing budgets beside their goals.
//! A file a link.

fn main() {
    benches::main(&[]);
}
