//! The settings of the codec and of both ends in the tool.

use super::plant::Plant;
use crate::settings::{Configure, FieldVisitor};
use kawasaki_msg::{PcConfig, RobotConfig};

/// The settings of `decode` and `encode`.
#[derive(Debug, Clone, Default)]
pub struct CodecSettings {
    /// The messages and jobs of the plant.
    pub plant: Plant,
    /// Whether messages are read and written by their roles in the plant's table.
    pub roles: bool,
}

impl Configure for CodecSettings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { plant, roles } = self;
        let about = "message objects have a role and values instead of a name and fields";
        fields.flag("roles", about, roles);
        plant.configure(fields);
    }
}

/// Offers the settings of a robot that do not follow from the plant.
pub fn robot_settings(fields: &mut impl FieldVisitor, config: &mut RobotConfig) {
    fields.without(&["limits", "datagrams", "max_number", "acks"], |fields| config.configure(fields));
}

/// Offers the settings of a PC that do not follow from the plant.
pub fn pc_settings(fields: &mut impl FieldVisitor, config: &mut PcConfig) {
    let agreed = ["limits", "datagrams", "max_number", "cumulative_acks"];
    fields.without(&agreed, |fields| config.configure(fields));
}
