//! The simulated ends of the links, one folder each.
//!
//! A new device is a line of [`DEVICES`].

pub mod control;
pub mod device;
pub mod fanuc_hmi_modbus;
pub mod isra_ball;
pub mod kawasaki_msg;
pub mod laser_eb90;
pub mod mmacell_proto;
pub mod on_line;
pub mod val2_alter;
pub mod val2_viewer;

use anyhow::Context;
use cellwire_links::settings::did_you_mean;
use cellwire_links::{LINKS, Link};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use self::device::Device;

/// Every end that can be simulated, in the order of the links.
pub static DEVICES: [Device; 9] = [
    kawasaki_msg::ROBOT,
    kawasaki_msg::PC,
    val2_alter::PUMA,
    val2_viewer::VIEWER,
    isra_ball::BALL,
    fanuc_hmi_modbus::FANUC,
    laser_eb90::LASER,
    mmacell_proto::ROBOT,
    mmacell_proto::PLATFORM,
];

/// The parser of LINK on the command line.
pub fn link_parser() -> impl TypedValueParser<Value = &'static Link> {
    let names = LINKS.iter().map(|link| PossibleValue::new(link.short).alias(link.name).help(link.about));
    PossibleValuesParser::new(names).try_map(|name| Link::by_name(&name))
}

/// The device of this name.
///
/// # Errors
/// When there is none, or the link of this name has two.
pub fn device_by_name(name: &str) -> anyhow::Result<&'static Device> {
    DEVICES.iter().find(|device| device.is_called(name)).with_context(|| {
        let names: Vec<&str> = DEVICES.iter().map(|device| device.name).collect();
        if let Some(link) = links_of_two().find(|link| [link.short, link.name].contains(&name)) {
            let both: Vec<&str> = names.into_iter().filter(|name| name.starts_with(link.short)).collect();
            return format!("{} has two ends: say {}", link.short, both.join(" or "));
        }
        let meant = did_you_mean(name, &names);
        format!("there is no device {name}; the devices are {}{meant}", names.join(", "))
    })
}

/// The links whose name is that of no device, since they have two.
fn links_of_two() -> impl Iterator<Item = &'static Link> {
    LINKS.iter().filter(|link| !DEVICES.iter().any(|device| device.is_called(link.short)))
}

/// The parser of DEVICE on the command line.
pub fn device_parser() -> impl TypedValueParser<Value = &'static Device> {
    let devices = DEVICES
        .iter()
        .map(|device| PossibleValue::new(device.name).aliases(device.aliases()).help(device.about));
    let refused = links_of_two().map(|link| PossibleValue::new(link.short).alias(link.name).hide(true));
    PossibleValuesParser::new(devices.chain(refused)).try_map(|name| device_by_name(&name))
}
