//! A configuration, field by field: the one list of its fields, from which programs read it, write it and show it.
//!
//! ```
//! use core::time::Duration;
//! use robot_session::spec::{ANY_TIME, Configure, Fields};
//!
//! struct HostConfig {
//!     resends: u8,
//!     timeout: Duration,
//! }
//!
//! impl Configure for HostConfig {
//!     fn configure(&mut self, fields: &mut impl Fields) {
//!         // Without `..`: a field that has no line does not compile.
//!         let Self { resends, timeout } = self;
//!         fields.whole("resends", 0..=u8::MAX, "times", "how often a frame is sent again", resends);
//!         fields.source("§3.4").time("timeout", ANY_TIME, "the reply timeout", timeout);
//!     }
//! }
//! ```

extern crate alloc;

use alloc::string::String;
use core::fmt::Display;
use core::ops::RangeInclusive;
use core::time::Duration;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Any time; [`Duration::MAX`] means never.
pub const ANY_TIME: RangeInclusive<Duration> = Duration::ZERO..=Duration::MAX;

/// A time above zero; [`Duration::MAX`] means never.
pub const SOME_TIME: RangeInclusive<Duration> = Duration::from_nanos(1)..=Duration::MAX;

/// What a baud rate is for.
pub const LINE: &str = "the rate of the serial line, 10 bits a byte";

/// A configuration whose fields have names.
pub trait Configure {
    /// Visits every field, each by one call.
    fn configure(&mut self, fields: &mut impl Fields);
}

/// Nothing to configure.
impl Configure for () {
    fn configure(&mut self, _: &mut impl Fields) {}
}

/// A whole number of a field.
pub trait Whole: TryFrom<i64> + PartialOrd + Display + Copy {}

impl<T: TryFrom<i64> + PartialOrd + Display + Copy> Whole for T {}

/// A text of a program.
pub type Str = &'static str;

/// Who visits the fields of a configuration, and reads or changes them.
///
/// `about` is a line of what the field is for, and what limits it beside its range: other fields, for example.
pub trait Fields {
    /// Where the link's source has the next field, such as `§3.4`. A field without is ours.
    fn source(&mut self, section: Str) -> &mut Self;

    /// A whole number within a range.
    fn whole<T: Whole>(&mut self, name: &str, range: RangeInclusive<T>, unit: Str, about: Str, field: &mut T);

    /// A whole number within a range, or what happens by default, which `otherwise` names.
    fn whole_or<T: Whole>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        unit: Str,
        otherwise: Str,
        about: Str,
        field: &mut Option<T>,
    );

    /// Whole numbers within a range, as many as there are fields.
    fn wholes<T: Whole>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        unit: Str,
        about: Str,
        fields: &mut [T],
    );

    /// A number within a range.
    fn real(&mut self, name: &str, range: RangeInclusive<f64>, unit: Str, about: Str, field: &mut f64);

    /// The field `baud`, above 0; see [`LINE`].
    fn baud(&mut self, about: Str, field: &mut u32);

    /// `true` or `false`.
    fn flag(&mut self, name: &str, about: Str, field: &mut bool);

    /// The field `echo`: whether the line returns what is sent, see [`Echo`](crate::end::Echo).
    fn echo(&mut self, field: &mut bool) {
        let about = "the line returns what is sent, as adapters for two wires do: it is compared and dropped";
        self.flag("echo", about, field);
    }

    /// A time.
    fn time(&mut self, name: &str, range: RangeInclusive<Duration>, about: Str, field: &mut Duration);

    /// A time, or what happens without one, which `otherwise` names.
    fn time_or(
        &mut self,
        name: &str,
        range: RangeInclusive<Duration>,
        otherwise: Str,
        about: Str,
        field: &mut Option<Duration>,
    );

    /// One of a few words, or of a few numbers.
    fn choice<T: PartialEq + Copy>(&mut self, name: &str, choices: &[(Str, T)], about: Str, field: &mut T);

    /// A text such as the name of a file; without one happens what `otherwise` says.
    fn text(&mut self, name: &str, shape: Str, otherwise: Str, about: Str, field: &mut Option<String>);

    /// A value with parts, in the shape that its `serde` form has.
    fn parsed<T: Serialize + DeserializeOwned>(&mut self, name: &str, shape: Str, about: Str, field: &mut T);

    /// What is given in code alone: no value can be read, and `default` names that of an unchanged configuration.
    fn code(&mut self, name: &str, shape: Str, default: Str, about: Str);

    /// A field that is a configuration of its own, of the type `of`.
    fn part(&mut self, name: &str, of: Str, about: Str, part: &mut impl Configure);

    /// The same, where a user need not name it: the fields in it have other names than those around it.
    fn inline(&mut self, name: &str, of: Str, about: Str, part: &mut impl Configure);

    /// Visits fields whose names begin with `name` and a dot.
    fn group(&mut self, name: &str, visit: impl FnOnce(&mut Self));

    /// Visits fields, but for those of these names, which something else decides.
    fn without(&mut self, names: &[Str], visit: impl FnOnce(&mut Self));
}
