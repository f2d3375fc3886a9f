//! All tests of the tool, in one program: one a file would take minutes to link.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::indexing_slicing,
    clippy::std_instead_of_core,
    reason = "tests of a program"
)]

#[cfg(target_os = "linux")]
mod at_terminal;
mod background_task;
mod capture;
mod captures;
mod commands;
mod connections;
mod control;
mod controller;
#[cfg(target_os = "linux")]
mod danger;
mod fanuc;
mod fanuc_cell;
mod fanuc_program;
mod fanuc_telemetry;
mod fanuc_write;
#[cfg(target_os = "linux")]
mod handshake;
mod identify;
#[cfg(unix)]
mod identify_draft;
#[cfg(unix)]
mod identify_line;
#[cfg(target_os = "linux")]
mod inputs;
mod json;
mod kawasaki;
mod kawasaki_plant;
mod kawasaki_run;
mod kawasaki_tables;
#[cfg(unix)]
mod laser;
#[cfg(unix)]
mod laser_drawing;
mod laser_program;
mod laser_run;
#[cfg(target_os = "linux")]
mod limits;
mod line_ends;
mod losses;
mod ls_edit;
mod ls_lsp;
mod ls_run;
#[cfg(unix)]
mod mma_run;
mod modbus_bench;
mod modbus_devices;
mod modbus_scan;
mod operated;
#[cfg(target_os = "linux")]
mod outcomes;
#[cfg(target_os = "linux")]
mod peers;
#[cfg(unix)]
mod puma;
mod real_time;
#[cfg(unix)]
mod replay;
#[cfg(unix)]
mod resumed;
#[cfg(target_os = "linux")]
mod rig;
mod settings;
#[cfg(unix)]
mod shadow;
#[cfg(target_os = "linux")]
mod stop;
#[cfg(unix)]
mod tap;
#[cfg(unix)]
mod tap_delay;
#[cfg(unix)]
mod tap_end;
#[cfg(unix)]
mod teleop;
mod tls;
mod tool;
