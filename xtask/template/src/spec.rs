//! The configurations of both ends, field by field.

use robot_session::spec::{Configure, FieldVisitor, SOME_TIME};

use crate::device::DeviceConfig;
use crate::host::HostConfig;

impl Configure for HostConfig {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            timeout,
            #[cfg(feature = "model")]
                rules: _,
        } = self;
        fields.time("timeout", SOME_TIME, "how long a reply may take", timeout);
    }
}

impl Configure for DeviceConfig {
    fn configure(&mut self, _: &mut impl FieldVisitor) {
        let Self {
            #[cfg(feature = "model")]
                rules: _,
        } = self;
    }
}

#[cfg(feature = "settings")]
robot_session::deserialize!(DeviceConfig, DeviceConfig::default());
#[cfg(feature = "settings")]
robot_session::deserialize!(HostConfig, HostConfig::default());
