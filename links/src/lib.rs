#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![allow(clippy::std_instead_of_core, reason = "a table for programs with std")]
#![allow(clippy::unit_arg, reason = "a call that gives nothing is done")]

pub mod codec;
pub mod end;
pub mod explain;
pub mod fanuc_hmi_modbus;
mod given;
pub mod isra_ball;
pub mod json;
pub mod kawasaki_msg;
pub mod laser_eb90;
pub mod link;
pub mod mmacell_proto;
mod parts;
pub mod reference;
pub mod settings;
pub mod shadow;
pub mod val2_alter;
pub mod val2_viewer;
pub mod vectors;

pub use link::Link;

/// Every link, in the order in which `cellwire demo` runs them.
pub static LINKS: &[Link] = &[
    kawasaki_msg::LINK,
    val2_alter::LINK,
    val2_viewer::LINK,
    isra_ball::LINK,
    fanuc_hmi_modbus::LINK,
    laser_eb90::LINK,
    mmacell_proto::LINK,
];
