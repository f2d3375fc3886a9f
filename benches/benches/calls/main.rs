//! `cargo bench -p benches --bench calls [-- [LINK] [--check] [--write]]`: the instructions of a call over TCP through each
//! link's handle, which waits for its reply. The ends by themselves are in `budgets`: the compiler inlines less of an end
//! that a handle uses too.

mod fanuc_hmi_modbus;
mod isra_ball;
mod kawasaki_msg;
mod laser_eb90;
mod mmacell_proto;
mod peer;
mod val2_alter;
mod val2_viewer;

fn main() -> std::process::ExitCode {
    benches::main(
        "calls",
        &[
            fanuc_hmi_modbus::LINK,
            isra_ball::LINK,
            kawasaki_msg::LINK,
            laser_eb90::LINK,
            mmacell_proto::LINK,
            val2_alter::LINK,
            val2_viewer::LINK,
        ],
    )
}
