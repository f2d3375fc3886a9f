//! The simulated ends of the links, one folder each.
//!
//! A new device is a line of [`DEVICES`].

pub mod control;
pub mod device;
pub mod fanuc_hmi_modbus;
pub mod host;
pub mod isra_ball;
pub mod kawasaki_msg;
pub mod laser_eb90;
pub mod mmacell_proto;
pub mod on_line;
pub mod val2_alter;
pub mod val2_viewer;

use std::ffi::OsStr;
use std::path::Path;

use anyhow::Context;
use cellwire_io::output::quoted;
use cellwire_links::settings::did_you_mean;
use cellwire_links::{LINKS, Link};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::error::{ContextKind, ContextValue, ErrorKind};
use clap::{Arg, Command, Error};

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

/// Returns the parser for LINK on the command line.
pub fn link_parser() -> impl TypedValueParser<Value = &'static Link> {
    let names = LINKS.iter().map(|link| PossibleValue::new(link.short).alias(link.name).help(link.about));
    LinkParser(PossibleValuesParser::new(names))
}

/// The name of a link; a file in its place is one whose link is not known yet.
#[derive(Clone)]
struct LinkParser(PossibleValuesParser);

impl TypedValueParser for LinkParser {
    type Value = &'static Link;

    fn parse_ref(&self, command: &Command, arg: Option<&Arg>, value: &OsStr) -> Result<Self::Value, Error> {
        let name = self.0.parse_ref(command, arg, value).map_err(|mut error| {
            if Path::new(value).is_file() {
                let file = quoted(&value.to_string_lossy());
                let tip =
                    format!("LINK comes before the file; `cellwire identify {file}` finds out which it is");
                error.insert(ContextKind::Suggested, ContextValue::StyledStrs(vec![tip.into()]));
            }
            error
        })?;
        Link::by_name(&name).map_err(|error| Error::raw(ErrorKind::InvalidValue, error))
    }

    fn possible_values(&self) -> Option<Box<dyn Iterator<Item = PossibleValue> + '_>> {
        self.0.possible_values()
    }
}

/// Returns the device of this name.
///
/// # Errors
/// When the name is unknown, or belongs to a link with two devices.
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

/// Returns the links that have two devices, so that no device has their name.
fn links_of_two() -> impl Iterator<Item = &'static Link> {
    LINKS.iter().filter(|link| !DEVICES.iter().any(|device| device.is_called(link.short)))
}

/// Returns the parser for DEVICE on the command line.
pub fn device_parser() -> impl TypedValueParser<Value = &'static Device> {
    let devices = DEVICES
        .iter()
        .map(|device| PossibleValue::new(device.name).aliases(device.aliases()).help(device.about));
    let refused = links_of_two().map(|link| PossibleValue::new(link.short).alias(link.name).hide(true));
    PossibleValuesParser::new(devices.chain(refused)).try_map(|name| device_by_name(&name))
}
