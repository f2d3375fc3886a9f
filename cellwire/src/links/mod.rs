//! The links that the tool knows, one folder each: its codec, and its simulated ends.
//!
//! A new link is a folder and a line of [`LINKS`].

pub mod codec;
pub mod device;
pub mod fanuc_hmi_modbus;
pub mod isra_ball;
pub mod kawasaki_msg;
pub mod laser_eb90;
pub mod link;
pub mod mmacell_proto;
pub mod settings;
pub mod val2_alter;
pub mod val2_viewer;

use anyhow::{Context, Result, bail};
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

use self::device::Device;
use self::link::Link;

/// Every link, in the order in which `demo` runs them.
pub static LINKS: [&dyn Link; 7] = [
    &kawasaki_msg::KawasakiMsg,
    &val2_alter::Val2Alter,
    &val2_viewer::Val2Viewer,
    &isra_ball::IsraBall,
    &fanuc_hmi_modbus::FanucHmiModbus,
    &laser_eb90::LaserEb90,
    &mmacell_proto::MmacellProto,
];

/// The link of this name.
///
/// # Errors
/// When there is none.
pub fn by_name(name: &str) -> Result<&'static dyn Link> {
    LINKS.into_iter().find(|link| link.name() == name).with_context(|| format!("no link is called {name}"))
}

/// A side of a link by its name, or the first.
///
/// # Errors
/// When the link has no such side.
pub fn side(link: &dyn Link, from: Option<&str>) -> Result<&'static str> {
    let sides = link.sides();
    let found = sides.iter().find(|side| from.is_none_or(|from| **side == from));
    match found {
        Some(side) => Ok(side),
        None => bail!(
            "{} has no side `{}`: use --from {}",
            link.name(),
            from.unwrap_or_default(),
            sides.join(" or --from ")
        ),
    }
}

/// The parser of LINK on the command line.
pub fn link_parser() -> impl TypedValueParser<Value = &'static dyn Link> {
    let names = LINKS.map(|link| PossibleValue::new(link.name()).help(link.about()));
    PossibleValuesParser::new(names).try_map(|name| by_name(&name))
}

/// Every end that can be simulated.
pub fn devices() -> impl Iterator<Item = &'static dyn Device> {
    LINKS.into_iter().flat_map(|link| link.devices().iter().copied())
}

/// The parser of DEVICE on the command line.
pub fn device_parser() -> impl TypedValueParser<Value = &'static dyn Device> {
    let names = devices().map(|device| PossibleValue::new(device.name()).help(device.about()));
    PossibleValuesParser::new(names).try_map(move |name| {
        devices().find(|device| device.name() == name).with_context(|| format!("no device is called {name}"))
    })
}
