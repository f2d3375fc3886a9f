//! The configuration of the host.

use std::path::PathBuf;

use cellwire_motion::latch::LatchConfig;
use val2_alter::{HostConfig, Limits};

use super::input::InputConfig;
use super::port::PortConfig;
use super::profile::Profile;

/// The configuration of the host.
#[derive(Debug, Clone)]
pub struct TeleopConfig {
    /// The port of the robot's line.
    pub robot: PortConfig,
    /// The source of the hand's values.
    pub input: InputConfig,
    /// The file that stores the reports of the input; `None` without.
    pub record: Option<PathBuf>,
    /// The port of the workstation's line; `None` without.
    pub viewer: Option<PortConfig>,
    /// The settings of the answers to the workstation.
    pub viewer_host: val2_viewer::HostConfig,
    /// The settings of the ALTER session.
    pub alter: HostConfig,
    /// The settings of the polls of the ball.
    pub polls: isra_ball::HostConfig,
    /// The meaning of the hand's values.
    pub profile: Profile,
    /// The conditions under which the hand may move the arm.
    pub latch: LatchConfig,
}

/// Returns the session's defaults for a computer with an operating system: bytes that arrive together may be read far apart.
pub fn host_config() -> HostConfig {
    HostConfig { gap: None, ..HostConfig::default() }
}

/// Limits at which the source's Figure 9 is easily seen: 100 mm/s and 30 °/s, reached in a third of a second.
pub const LIMITS: Limits =
    Limits { velocity: [90, 90, 90, 150, 150, 150], acceleration: [8, 8, 8, 13, 13, 13] };
