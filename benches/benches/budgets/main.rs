//! `cargo bench -p benches --bench budgets [-- LINK]`: instruction counts and timing budgets beside their goals.
//! A file a link.

mod isra_ball;
mod laser_eb90;

fn main() {
    benches::main(&[isra_ball::LINK, laser_eb90::LINK]);
}
