//! The links that the tool knows, one folder each: its codec, its demo, its simulators.

pub mod fanuc_hmi_modbus;
pub mod isra_ball;
pub mod kawasaki_msg;
pub mod laser_eb90;
pub mod mmacell_proto;
pub mod val2_alter;
pub mod val2_viewer;

use anyhow::{Result, bail};
use clap::ValueEnum;
use serde_json::{Map, Value};

use crate::codec::Codec;
use crate::demo::DemoOptions;
use crate::report::Report;
use crate::settings;
use crate::simulate::SimulateOptions;

/// A link, by the name of its crate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Link {
    /// A Kawasaki robot and a PC; settings: charset, of the demo port, queue, speed
    KawasakiMsg,
    /// VAL II ALTER on a Unimation MARK III; settings: the fields of its Framing, of the demo baud, mode
    Val2Alter,
    /// The graphics workstation that draws the robot of val2-alter
    Val2Viewer,
    /// The ISRA Robot Command Teach Ball; settings: of the demo baud
    IsraBall,
    /// FANUC's HMI Device Communication, Modbus; settings: framing, view, word_order
    FanucHmiModbus,
    /// A laser machining robot, EB 90 frames; settings: the fields of its Profile, of the demo baud
    LaserEb90,
    /// The MM&A micro-manipulation cell; settings: the fields of its Dialect, of the demo parts, speed, stall_every
    MmacellProto,
}

impl Link {
    /// Every link, in the order in which `demo` runs them.
    pub fn all() -> &'static [Self] {
        Self::value_variants()
    }

    /// The crate's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::KawasakiMsg => "kawasaki-msg",
            Self::Val2Alter => "val2-alter",
            Self::Val2Viewer => "val2-viewer",
            Self::IsraBall => "isra-ball",
            Self::FanucHmiModbus => "fanuc-hmi-modbus",
            Self::LaserEb90 => "laser-eb90",
            Self::MmacellProto => "mmacell-proto",
        }
    }

    /// The names of the sides that send, for `--from`; the first is the default.
    pub fn sides(self) -> &'static [&'static str] {
        match self {
            Self::KawasakiMsg => &["pc", "robot"],
            Self::Val2Alter => &["robot", "host"],
            Self::Val2Viewer => &["host"],
            Self::IsraBall => &["ball"],
            Self::FanucHmiModbus => &["client", "server"],
            Self::LaserEb90 => &["host", "controller"],
            Self::MmacellProto => &["central", "robot", "platform"],
        }
    }

    /// The side that sends, in a capture: the TCP client, or the server on this port.
    pub fn sender(self, is_client: bool, server_port: u16) -> &'static str {
        match self {
            // The robot opens the connection.
            Self::KawasakiMsg if is_client => "robot",
            Self::KawasakiMsg => "pc",
            // Serial device servers listen: the robot is connected to one.
            Self::Val2Alter | Self::LaserEb90 if is_client => "host",
            Self::Val2Alter => "robot",
            Self::LaserEb90 => "controller",
            Self::Val2Viewer => "host",
            Self::IsraBall => "ball",
            Self::FanucHmiModbus if is_client => "client",
            Self::FanucHmiModbus => "server",
            Self::MmacellProto if is_client => "central",
            Self::MmacellProto if server_port == ::mmacell_proto::port::PLATFORM => "platform",
            Self::MmacellProto => "robot",
        }
    }

    /// The codec of what a side sends.
    ///
    /// # Errors
    /// When an option does not fit this link.
    pub fn codec(self, options: &CodecOptions) -> Result<Box<dyn Codec>> {
        let side = self.side(options.from.as_deref())?;
        match self {
            Self::KawasakiMsg => kawasaki_msg::codec(options),
            Self::Val2Alter => val2_alter::codec(side, options),
            Self::Val2Viewer => val2_viewer::codec(options),
            Self::IsraBall => isra_ball::codec(options),
            Self::FanucHmiModbus => fanuc_hmi_modbus::codec(side, options),
            Self::LaserEb90 => laser_eb90::codec(options),
            Self::MmacellProto => mmacell_proto::codec(side, options),
        }
    }

    /// Runs the link end to end.
    ///
    /// # Errors
    /// When the demo cannot be set up: a port in use, a file that does not exist.
    pub fn demo(self, options: &DemoOptions) -> Result<Report> {
        match self {
            Self::KawasakiMsg => kawasaki_msg::demo(options),
            Self::Val2Alter => val2_alter::demo(options),
            Self::Val2Viewer => val2_viewer::demo(options),
            Self::IsraBall => isra_ball::demo(options),
            Self::FanucHmiModbus => fanuc_hmi_modbus::demo(options),
            Self::LaserEb90 => laser_eb90::demo(options),
            Self::MmacellProto => mmacell_proto::demo(options),
        }
    }

    fn side(self, from: Option<&str>) -> Result<&'static str> {
        let sides = self.sides();
        let Some(from) = from else {
            return sides.first().copied().ok_or_else(|| anyhow::anyhow!("no sides"));
        };
        match sides.iter().find(|side| **side == from) {
            Some(side) => Ok(side),
            None => bail!("{} has no side `{from}`: use --from {}", self.name(), sides.join(" or --from ")),
        }
    }
}

/// How to read and write a link's bytes.
#[derive(Debug, Clone, Default)]
pub struct CodecOptions {
    /// The side that sends.
    pub from: Option<String>,
    /// Settings other than the link's defaults, as in the vectors' `options`: `{"framing":"rtu"}`. A link refuses a name
    /// that it does not know.
    pub settings: Map<String, Value>,
}

/// The settings of `decode` and `encode` on the command line.
#[derive(Debug, clap::Args)]
pub struct CodecArgs {
    /// The link's crate name
    pub link: Link,
    /// The side that sends the bytes [default: the first of the link's sides]
    #[arg(long, value_name = "SIDE")]
    from: Option<String>,
    /// A setting of the link other than its default, such as leading_dle=1; the link's page lists them
    #[arg(long, value_name = "NAME=VALUE", value_parser = settings::parse)]
    set: Vec<(String, Value)>,
    /// fanuc-hmi-modbus: tcp or rtu, the same as --set framing=… [default: tcp]
    #[arg(long, value_name = "FRAMING")]
    framing: Option<String>,
    /// fanuc-hmi-modbus: telemetry shows 37 registers as the telemetry block, the same as --set view=…
    #[arg(long, value_name = "VIEW")]
    view: Option<String>,
}

impl CodecArgs {
    /// What the arguments set.
    pub fn options(&self) -> CodecOptions {
        let mut settings: Map<String, Value> = self.set.iter().cloned().collect();
        for (name, value) in [("framing", &self.framing), ("view", &self.view)] {
            if let Some(value) = value {
                settings.insert(name.into(), value.as_str().into());
            }
        }
        CodecOptions { from: self.from.clone(), settings }
    }
}

/// A simulated end of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Device {
    /// A Kawasaki robot that draws what a PC sends; settings: speed, queue, acks, out
    KawasakiRobot,
    /// A PC with a picture for a Kawasaki robot; settings: drawing, order, repeat
    KawasakiPc,
    /// The PUMA 562 on its MARK III; settings: baud, mode, subroutine, attempts, restart_ms
    Puma,
    /// The ISRA Robot Command Teach Ball with a hand on it; settings: baud
    Ball,
    /// The graphics workstation that draws the PUMA; settings: baud
    Viewer,
    /// A FANUC controller with a moving robot, over Modbus; settings: framing, unit, word_order, and on a serial line baud
    Fanuc,
    /// The controller of a laser robot; settings: baud, queue, execution_ms, and the fields of its Profile
    Laser,
    /// The robot of the MM&A cell; settings: speed, fail_every, mute_every, drop_every, the fields of its Dialect
    MmaRobot,
    /// The orientation platform of the MM&A cell; settings: those of mma-robot
    MmaPlatform,
}

impl Device {
    /// Runs the device until the process is interrupted.
    ///
    /// # Errors
    /// When its endpoint cannot be opened.
    pub fn simulate(self, options: &SimulateOptions) -> Result<()> {
        match self {
            Self::KawasakiRobot => kawasaki_msg::simulate::robot(options),
            Self::KawasakiPc => kawasaki_msg::simulate::pc(options),
            Self::Puma => val2_alter::puma::simulate(options),
            Self::Viewer => val2_viewer::workstation::simulate(options),
            Self::Ball => isra_ball::ball::simulate(options),
            Self::Fanuc => fanuc_hmi_modbus::simulate::simulate(options),
            Self::Laser => laser_eb90::controller::simulate(options),
            Self::MmaRobot => mmacell_proto::simulate::robot(options),
            Self::MmaPlatform => mmacell_proto::simulate::platform(options),
        }
    }
}
