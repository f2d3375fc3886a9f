/// What is accepted beyond the letter of the source. Everything is off by default; nothing here changes what is encoded.
///
/// The source contradicts itself in these places, and a peer may have been written from the other reading.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
pub struct Dialect {
    /// `ITR` is `STP`: §6 steps 17 and 20 use a word that §4 does not define.
    pub itr: bool,
    /// `OVRD` is `OVR`: so written in §6 step 4.
    pub ovrd: bool,
    /// `HND…CLOS` is `HND…CLOSE`: §4.10 counts 15 characters where its own fields add up to 16.
    pub clos: bool,
    /// `SRVOFF` is `SRVOF`.
    pub off: bool,
    /// A line may end with a line feed alone: §4 spells the end of a line in three ways.
    pub lone_lf: bool,
    /// One blank may stand behind the sign of an integer: §4 prints `+ 00001`.
    pub blank: bool,
    /// Five digits are taken as they stand, also above 32767.
    pub wide_integers: bool,
}

impl Dialect {
    /// Only what the source defines. The default.
    pub const STRICT: Self = Self {
        itr: false,
        ovrd: false,
        clos: false,
        off: false,
        lone_lf: false,
        blank: false,
        wide_integers: false,
    };

    /// Every other reading of the source too.
    pub const TOLERANT: Self = Self {
        itr: true,
        ovrd: true,
        clos: true,
        off: true,
        lone_lf: true,
        blank: true,
        wide_integers: true,
    };
}
