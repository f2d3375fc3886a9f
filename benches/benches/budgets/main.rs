//! `cargo bench -p benches --bench budgets [-- LINK]`: instruction counts and timing budgets beside their goals.
//! A file a link.

mod fanuc_hmi_modbus;
mod isra_ball;
mod laser_eb90;

fn main() {
    benches::main(&[fanuc_hmi_modbus::LINK, isra_ball::LINK, laser_eb90::LINK]);
}
