//! What the tool sets of the codec and of both ends.

use super::plant::Plant;
use crate::settings::{Configure, Fields};
use kawasaki_msg::{PcConfig, RobotConfig};

/// What `decode` and `encode` are set to.
#[derive(Debug, Clone, Default)]
pub struct CodecSettings {
    /// The plant's messages.
    pub plant: Plant,
    /// Messages are read and written as what they mean in the plant's table.
    pub roles: bool,
}

impl Configure for CodecSettings {
    fn configure(&mut self, fields: &mut impl Fields) {
        let Self { plant, roles } = self;
        let about = "message objects have a role and values instead of a name and fields";
        fields.flag("roles", about, roles);
        plant.configure(fields);
    }
}

/// What of a robot's configuration the plant does not decide.
pub fn robot_settings(fields: &mut impl Fields, config: &mut RobotConfig) {
    fields.without(&["limits", "datagrams", "max_number", "acks"], |fields| config.configure(fields));
}

/// What of a PC's configuration the plant does not decide.
pub fn pc_settings(fields: &mut impl Fields, config: &mut PcConfig) {
    let agreed = ["limits", "datagrams", "max_number", "cumulative_acks"];
    fields.without(&agreed, |fields| config.configure(fields));
}
