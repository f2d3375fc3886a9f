#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]
#![cfg_attr(
    not(all(
        feature = "captures",
        feature = "fanuc-hmi-modbus",
        feature = "isra-ball",
        feature = "kawasaki-msg",
        feature = "laser-eb90",
        feature = "mmacell-proto",
        feature = "val2-alter",
        feature = "val2-viewer"
    )),
    allow(dead_code, reason = "functions for what is left out of the table")
)]
#![allow(clippy::std_instead_of_core, reason = "a table for programs with std")]
#![allow(clippy::unit_arg, reason = "a call that gives nothing is done")]

pub mod codec;
pub mod end;
pub mod explain;
#[cfg(feature = "fanuc-hmi-modbus")]
pub mod fanuc_hmi_modbus;
mod given;
#[cfg(feature = "isra-ball")]
pub mod isra_ball;
pub mod json;
#[cfg(feature = "kawasaki-msg")]
pub mod kawasaki_msg;
#[cfg(feature = "laser-eb90")]
pub mod laser_eb90;
pub mod link;
#[cfg(feature = "mmacell-proto")]
pub mod mmacell_proto;
mod parts;
pub mod reference;
pub mod settings;
pub mod shadow;
#[cfg(feature = "val2-alter")]
pub mod val2_alter;
#[cfg(feature = "val2-viewer")]
pub mod val2_viewer;
pub mod vectors;

pub use link::Link;

/// Every link, in the order in which `cellwire demo` runs them.
pub static LINKS: &[Link] = &[
    #[cfg(feature = "kawasaki-msg")]
    kawasaki_msg::LINK,
    #[cfg(feature = "val2-alter")]
    val2_alter::LINK,
    #[cfg(feature = "val2-viewer")]
    val2_viewer::LINK,
    #[cfg(feature = "isra-ball")]
    isra_ball::LINK,
    #[cfg(feature = "fanuc-hmi-modbus")]
    fanuc_hmi_modbus::LINK,
    #[cfg(feature = "laser-eb90")]
    laser_eb90::LINK,
    #[cfg(feature = "mmacell-proto")]
    mmacell_proto::LINK,
];
