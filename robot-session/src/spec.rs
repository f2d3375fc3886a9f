//! A configuration, field by field: the one list of its fields, from which programs read it, write it and show it.
//!
//! ```
//! use core::time::Duration;
//! use robot_session::spec::{ANY_TIME, Configure, FieldVisitor};
//!
//! struct HostConfig {
//!     resends: u8,
//!     timeout: Duration,
//! }
//!
//! impl Configure for HostConfig {
//!     fn configure(&mut self, fields: &mut impl FieldVisitor) {
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

/// The text of help for the field `baud`.
pub const LINE: &str = "the rate of the serial line, 10 bits a byte";

/// A configuration that names its fields.
pub trait Configure {
    /// Visits every field, each by one call.
    fn configure(&mut self, fields: &mut impl FieldVisitor);
}

/// The configuration without fields.
impl Configure for () {
    fn configure(&mut self, _: &mut impl FieldVisitor) {}
}

/// A whole number of a field.
pub trait WholeNumber: TryFrom<i64> + PartialOrd + Display + Copy {}

impl<T: TryFrom<i64> + PartialOrd + Display + Copy> WholeNumber for T {}

/// A text of the program.
pub type Str = &'static str;

/// A visitor of a configuration's fields, which reads or changes them.
///
/// `about` is one line: the purpose of the field, and its limits beside the range, such as other fields.
pub trait FieldVisitor {
    /// Sets the section of the link's source that specifies the next field, such as `§3.4`. A field without a section is this
    /// project's own.
    fn source(&mut self, section: Str) -> &mut Self;

    /// Visits a whole number within a range.
    fn whole<T: WholeNumber>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        unit: Str,
        about: Str,
        field: &mut T,
    );

    /// Visits a whole number within a range, which need not be given; `otherwise` names the behaviour without it.
    fn whole_or<T: WholeNumber>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        unit: Str,
        otherwise: Str,
        about: Str,
        field: &mut Option<T>,
    );

    /// Visits whole numbers within a range, as many as there are fields.
    fn wholes<T: WholeNumber>(
        &mut self,
        name: &str,
        range: RangeInclusive<T>,
        unit: Str,
        about: Str,
        fields: &mut [T],
    );

    /// Visits a number within a range.
    fn real(&mut self, name: &str, range: RangeInclusive<f64>, unit: Str, about: Str, field: &mut f64);

    /// Visits the field `baud`, above 0; see [`LINE`].
    fn baud(&mut self, about: Str, field: &mut u32);

    /// Visits a field that is `true` or `false`.
    fn flag(&mut self, name: &str, about: Str, field: &mut bool);

    /// Visits the field `echo`: whether the line returns the bytes sent, see [`Echo`](crate::end::Echo).
    fn echo(&mut self, field: &mut bool) {
        let about = "the line returns what is sent, as adapters for two wires do: it is compared and dropped";
        self.flag("echo", about, field);
    }

    /// Visits a time.
    fn time(&mut self, name: &str, range: RangeInclusive<Duration>, about: Str, field: &mut Duration);

    /// Visits a time, which need not be given; `otherwise` names the behaviour without it.
    fn time_or(
        &mut self,
        name: &str,
        range: RangeInclusive<Duration>,
        otherwise: Str,
        about: Str,
        field: &mut Option<Duration>,
    );

    /// Visits one of a few words, or of a few numbers.
    fn choice<T: PartialEq + Copy>(&mut self, name: &str, choices: &[(Str, T)], about: Str, field: &mut T);

    /// Visits a text such as the name of a file; `otherwise` names the behaviour without it.
    fn text(&mut self, name: &str, shape: Str, otherwise: Str, about: Str, field: &mut Option<String>);

    /// Visits a value with parts, in the shape of its `serde` form.
    fn parsed<T: Serialize + DeserializeOwned>(&mut self, name: &str, shape: Str, about: Str, field: &mut T);

    /// Visits a field that is set in code alone: no value can be read, and `default` names the value of an unchanged
    /// configuration.
    fn code(&mut self, name: &str, shape: Str, default: Str, about: Str);

    /// Visits a field that is a configuration of its own, of the type `of`.
    fn part(&mut self, name: &str, of: Str, about: Str, part: &mut impl Configure);

    /// As [`part`](Self::part), but a user need not write its name: its fields have other names than those around it.
    fn inline(&mut self, name: &str, of: Str, about: Str, part: &mut impl Configure);

    /// Visits fields whose names begin with `name` and a dot.
    fn group(&mut self, name: &str, visit: impl FnOnce(&mut Self));

    /// Visits fields, except for those with these names, which are decided elsewhere.
    fn without(&mut self, names: &[Str], visit: impl FnOnce(&mut Self));
}
