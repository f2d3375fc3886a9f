//! The conversion of the hand's values to targets of the robot.

use serde::de::{Deserialize, Deserializer, Error as _};
use serde::{Serialize, Serializer};
use val2_alter::{AXES, Accumulation, Limits, Mode, Scale};

use super::filter::{Axes, Filter};
use super::sample::{FULL, Sample};
use cellwire_links::settings::{Configure, FieldVisitor};

/// The conversion of the hand's values to targets of the robot. Signs and units of both ends are open in the source, so try it
/// slowly.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    /// The ball's TRA, ROT and DOM keys, in software.
    pub filter: Filter,
    /// Values up to this count as none, in percent of the full deflection: 0 to 50. The springs never stand quite still.
    pub dead_zone: u8,
    /// The speed that full deflection asks for, in percent of the limits. Above 100 the limits cut it.
    pub speed: u16,
    /// The speed of each axis of the robot, in percent of `speed`: -200 to 200. A negative one turns the axis round.
    pub gain: [i16; AXES],
    /// The axis of the input that each axis of the robot follows.
    pub axes: [AxisSource; AXES],
    /// Non-cumulative ALTER: the distance off the path that full deflection asks for, in mm.
    pub reach_mm: u16,
    /// Non-cumulative ALTER: the turn off the path that full deflection asks for, in degrees.
    pub reach_degrees: u16,
    /// The button to be held, where the arm moves only while it is: 1 to 32.
    pub hold_key: u8,
    /// The limits of each axis per cycle.
    pub limits: Limits,
}

/// An axis of the input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AxisSource {
    /// X, Y, Z, RX, RY, RZ as 0 to 5; `None`: the robot's axis stays where it is.
    pub axis: Option<u8>,
    /// Whether the axis is reversed.
    pub is_inverted: bool,
}

impl AxisSource {
    /// The names of the axes.
    pub const NAMES: [&'static str; AXES] = ["x", "y", "z", "rx", "ry", "rz"];

    const fn same(axis: u8) -> Self {
        Self { axis: Some(axis), is_inverted: false }
    }
}

impl Profile {
    /// Creates the profile in which full deflection is `speed` percent of the highest velocity; or 50 mm and 10° off the
    /// path.
    pub const fn for_limits(limits: Limits, speed: u16) -> Self {
        Self {
            filter: Filter::NONE,
            dead_zone: 4,
            speed,
            gain: [100; AXES],
            axes: [
                AxisSource::same(0),
                AxisSource::same(1),
                AxisSource::same(2),
                AxisSource::same(3),
                AxisSource::same(4),
                AxisSource::same(5),
            ],
            reach_mm: 50,
            reach_degrees: 10,
            hold_key: 8,
            limits,
        }
    }

    /// Returns whether all axes are within the dead zone, passed by the filter or not.
    pub fn rests(&self, sample: &Sample) -> bool {
        sample.axes.iter().all(|value| self.without_play(*value) == 0)
    }

    /// Returns whether the enabling button is pressed.
    pub fn holds(&self, sample: &Sample) -> bool {
        let bit = self.hold_key.saturating_sub(1).into();
        sample.buttons.checked_shr(bit).is_some_and(|buttons| buttons & 1 != 0)
    }

    /// Returns the target of a sample, in units of ALTER's words.
    pub fn target(&self, sample: &Sample, mode: Mode) -> [i16; AXES] {
        let passed = self.filter.apply(sample.axes.map(|value| self.without_play(value)));
        let full = self.full(mode.accumulation());
        let mut target = [0; AXES];
        for (((target, source), gain), full) in target.iter_mut().zip(self.axes).zip(self.gain).zip(full) {
            let value = source.axis.and_then(|axis| passed.get(usize::from(axis))).copied().unwrap_or(0);
            let value = i64::from(value) * if source.is_inverted { -1 } else { 1 };
            let words = value * full * i64::from(gain) / (i64::from(FULL) * 100);
            *target = i16::try_from(words).unwrap_or(if words < 0 { i16::MIN } else { i16::MAX });
        }
        target
    }

    /// Returns the target of full deflection, in units of ALTER's words.
    fn full(&self, accumulation: Accumulation) -> [i64; AXES] {
        match accumulation {
            Accumulation::Cumulative => {
                self.limits.velocity.map(|most| i64::from(most) * i64::from(self.speed) / 100)
            }
            Accumulation::NonCumulative => {
                let mm = Scale::PUMA_562.translation_saturating(self.reach_mm.into()).into();
                let degrees = Scale::PUMA_562.rotation_saturating(self.reach_degrees.into()).into();
                [mm, mm, mm, degrees, degrees, degrees]
            }
        }
    }

    fn without_play(&self, value: i16) -> i16 {
        let play = u16::from(self.dead_zone) * FULL.unsigned_abs() / 100;
        if value.unsigned_abs() <= play { 0 } else { value }
    }
}

impl Configure for Profile {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let choices = [("all", Axes::All), ("tra", Axes::Translation), ("rot", Axes::Rotation)];
        fields.choice("filter", &choices, "the axes that pass", &mut self.filter.axes);
        let about = "pass only the strongest axis";
        fields.flag("dominant", about, &mut self.filter.dominant);
        let about = "values up to this count as zero; when all do, the input is at rest";
        fields.whole("dead_zone", 0..=50, "% of full deflection", about, &mut self.dead_zone);
        let about = "the speed at full deflection";
        fields.whole("speed", 1..=100, "% of the limits", about, &mut self.speed);
        let about = "the same for each axis of the robot; negative: reversed";
        fields.wholes("gain", -200..=200, "% of speed", about, &mut self.gain);
        let shape = "[6 of \"x\" \"y\" \"z\" \"rx\" \"ry\" \"rz\", with a minus for reversed, or \"none\"]";
        let about = "the input axis of the robot's X, Y, Z, RX, RY, RZ";
        fields.parsed("axes", shape, about, &mut self.axes);
        let about = "non-cumulative ALTER: the offset from the path at full deflection";
        fields.whole("reach_mm", 0..=1000, "mm", about, &mut self.reach_mm);
        fields.whole("reach_degrees", 0..=170, "°", about, &mut self.reach_degrees);
        let about = "the button for --hold-to-run";
        fields.whole("hold_key", 1..=32, "", about, &mut self.hold_key);
    }
}

impl AxisSource {
    fn name(self) -> String {
        let name = self.axis.and_then(|axis| Self::NAMES.get(usize::from(axis)));
        match name {
            None => "none".into(),
            Some(name) => format!("{}{name}", if self.is_inverted { "-" } else { "" }),
        }
    }
}

impl Serialize for AxisSource {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.name())
    }
}

impl<'de> Deserialize<'de> for AxisSource {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        let (is_inverted, name) = match text.strip_prefix('-') {
            Some(name) => (true, name),
            None => (false, text.as_str()),
        };
        let axis = Self::NAMES.iter().position(|known| *known == name);
        match axis.and_then(|axis| u8::try_from(axis).ok()) {
            Some(axis) => Ok(Self { axis: Some(axis), is_inverted }),
            None if text == "none" => Ok(Self { axis: None, is_inverted: false }),
            None => Err(D::Error::custom(format!("there is no axis `{text}`"))),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use cellwire_links::settings;

    const MODE: Mode = Mode::CUMULATIVE_23;

    fn sample(axes: [i16; 6]) -> Sample {
        Sample { axes, buttons: 0, fresh_until: Duration::MAX }
    }

    #[test]
    fn full_deflection_asks_for_the_full_amount_and_trembling_for_nothing() {
        let profile = Profile { dead_zone: 3, ..Profile::for_limits(Limits::GENTLE, 150) };
        let pushed = sample([1000, -1000, 30, -30, 500, -1000]);
        assert_eq!(profile.target(&pushed, MODE), [135, -135, 0, 0, 112, -225]);
        let off_path = profile.target(&pushed, Mode::NON_CUMULATIVE_22);
        assert_eq!(off_path, [1600, -1600, 0, 0, 910, -1820]);
        assert!(profile.rests(&sample([30, -30, 0, 0, 0, 30])));
        assert!(!profile.rests(&sample([31, 0, 0, 0, 0, 0])));
    }

    #[test]
    fn axes_are_exchanged_turned_round_weighed_and_left_out() {
        let mut profile = Profile::for_limits(Limits::GENTLE, 100);
        profile.axes = [
            AxisSource { axis: Some(1), is_inverted: false },
            AxisSource { axis: Some(0), is_inverted: true },
            AxisSource { axis: None, is_inverted: false },
            AxisSource::same(3),
            AxisSource::same(3),
            AxisSource::same(5),
        ];
        profile.gain = [100, 100, 100, 50, -200, 100];
        let pushed = sample([1000, 500, 1000, 1000, 1000, 0]);
        assert_eq!(profile.target(&pushed, MODE), [45, -90, 0, 75, -300, 0]);
        // A filter lets fewer axes pass; a hand that pushes the others is not at rest all the same.
        profile.filter = Filter { axes: Axes::Rotation, dominant: false };
        assert_eq!(profile.target(&pushed, MODE), [0, 0, 0, 75, -300, 0]);
        assert!(!profile.rests(&sample([1000, 0, 0, 0, 0, 0])));
    }

    #[test]
    fn a_profile_is_read_from_a_file_of_settings() {
        let read = |text: &str| {
            let given = toml::from_str(text).unwrap();
            settings::read("profile", Profile::for_limits(Limits::GENTLE, 100), &given)
        };
        let text = r#"
            filter = "tra"
            dominant = true
            dead_zone = 10
            gain = [50, 100, -100, 0, 0, 0]
            axes = ["y", "-x", "z", "none", "rx", "rz"]
        "#;
        let profile = read(text).unwrap();
        assert_eq!(profile.filter, Filter { axes: Axes::Translation, dominant: true });
        assert_eq!((profile.dead_zone, profile.gain), (10, [50, 100, -100, 0, 0, 0]));
        let names = profile.axes.map(AxisSource::name);
        assert_eq!(names, ["y", "-x", "z", "none", "rx", "rz"]);
        let error = |text| read(text).unwrap_err().to_string();
        assert!(error("axes = ['x', 'y', 'z', 'rx', 'ry', 'up']").contains("there is no axis `up`"));
        assert!(error("dead_zone = 51").contains("out of range"));
        assert!(
            error("deadzone = 5").ends_with("profile has no setting `deadzone`; did you mean `dead_zone`?")
        );
    }

    #[test]
    fn the_button_to_be_held_is_one_of_32() {
        let held = |hold_key, buttons| {
            let profile = Profile { hold_key, ..Profile::for_limits(Limits::GENTLE, 100) };
            profile.holds(&Sample { buttons, ..sample([0; 6]) })
        };
        assert_eq!([held(1, 1), held(8, 0x80), held(32, 1 << 31)], [true; 3]);
        assert_eq!([held(1, 2), held(8, 0x7F), held(33, u32::MAX)], [false; 3]);
    }
}
