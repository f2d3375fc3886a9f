//! The settings of a profile.

use anyhow::{Context, Result};
use laser_eb90::Profile;
use serde_json::{Map, Value};

use crate::links::settings::Settings;

/// The names of the settings of a profile: the fields of the crate's `Profile`.
pub(super) const PROFILE: [&str; 7] =
    ["tail", "flag", "tags", "checksum", "checksum_negated", "checksum_with_flag", "byte_order"];

/// A profile from settings: its fields by name, such as `tail=etx`.
///
/// # Errors
/// When a name is no field of `Profile`, or a value is none of the field's.
pub(super) fn profile(settings: &Map<String, Value>) -> Result<Profile> {
    Settings::new("laser-eb90", settings, &PROFILE)?;
    serde_json::from_value(Value::Object(settings.clone())).context("a setting of laser-eb90")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_settings_of_a_profile_are_its_fields() {
        let fields = serde_json::to_value(Profile::default()).unwrap();
        let names: Vec<_> = fields.as_object().unwrap().keys().cloned().collect();
        assert_eq!(names, PROFILE);
        let settings = Map::from_iter([("baud".into(), 9600.into())]);
        let error = profile(&settings).unwrap_err().to_string();
        assert!(error.starts_with("laser-eb90 has no setting `baud`: it has tail, flag"), "{error}");
    }
}
