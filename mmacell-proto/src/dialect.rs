/// The points on which the source contradicts itself, so that a peer may follow the other reading. Everything is off by
/// default: the source's own definition.
///
/// If a field is on, decoding accepts both readings, and encoding writes only the other one. So decoding and encoding have
/// two separate values: [`TOLERANT`](Self::TOLERANT) is for decoding.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(
    feature = "serde",
    derive(serde::Serialize, serde::Deserialize),
    serde(default, deny_unknown_fields)
)]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Dialect {
    /// Whether `ITR` is `STP`: §6 steps 17 and 20 use a word that §4 does not define.
    pub itr: bool,
    /// Whether `OVRD` is `OVR`: so written in §6 step 4.
    pub ovrd: bool,
    /// Whether `HND…CLOS` is `HND…CLOSE`: §4.10 counts 15 characters, but its own fields add up to 16.
    pub clos: bool,
    /// Whether `SRVOFF` is `SRVOF`.
    pub off: bool,
    /// Whether a line ends with a line feed alone: §4 spells the end of a line in three ways.
    pub lone_lf: bool,
    /// Whether a blank follows the sign of an integer: §4 prints `+ 00001`.
    pub blank: bool,
    /// Whether all five digits of an integer count, also above 32767.
    pub wide_integers: bool,
}

impl Dialect {
    /// The source's definition alone. The default.
    pub const STRICT: Self = Self {
        itr: false,
        ovrd: false,
        clos: false,
        off: false,
        lone_lf: false,
        blank: false,
        wide_integers: false,
    };

    /// Every other reading of the source.
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
