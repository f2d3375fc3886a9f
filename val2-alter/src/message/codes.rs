//! The codes of the messages. Every enum is total: a code that the source does not name is kept and is written again
//! unchanged.

/// Declares a code enum with `From<u8>`, `From<Code> for u8` and, with `serde`, its number as its serial form. The range has
/// the codes that its field on the wire can hold.
macro_rules! codes {
    ($(#[$doc:meta])* $name:ident in $codes:expr => { $($(#[$variant_doc:meta])* $variant:ident = $value:literal,)* }) => {
        $(#[$doc])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(from = "u8", into = "u8"))]
        pub enum $name {
            $($(#[$variant_doc])* $variant,)*
            /// A code that the source does not name.
            Other(u8),
        }

        impl From<u8> for $name {
            fn from(code: u8) -> Self {
                match code {
                    $($value => Self::$variant,)*
                    other => Self::Other(other),
                }
            }
        }

        impl From<$name> for u8 {
            fn from(code: $name) -> u8 {
                match code {
                    $($name::$variant => $value,)*
                    $name::Other(other) => other,
                }
            }
        }

        /// A code that the source names, or any other.
        #[cfg(feature = "arbitrary")]
        impl<'a> arbitrary::Arbitrary<'a> for $name {
            fn arbitrary(u: &mut arbitrary::Unstructured<'a>) -> arbitrary::Result<Self> {
                if u.arbitrary()? {
                    u.choose(&[$(Self::$variant),*]).copied()
                } else {
                    u.int_in_range($codes).map(|code: u8| code.into())
                }
            }
        }
    };
}

codes! {
    /// The error of the host's last reply (§3.2.2): three bits of the control byte.
    ErrorCode in 0..=7 => {
        /// No error.
        None = 0,
        /// The checksum did not fit.
        Checksum = 1,
        /// The fields did not fit.
        Format = 2,
        /// The reply was longer than the controller's buffer.
        Overflow = 3,
        /// The reply broke off.
        Incomplete = 4,
        /// The start or end mark was wrong.
        Mark = 5,
        /// The reply did not come in time.
        Timeout = 6,
    }
}

codes! {
    /// The state of the current motion segment (§3.2.2).
    SegmentStatus in 0..=255 => {
        /// No motion instruction has been executed yet.
        NoneYet = 1,
        /// The path is being followed.
        Normal = 2,
        /// The motion has ended at its location.
        Finished = 3,
        /// Nulling the position error at a location that was not planned. (The source's wording, "Positionsfehler wird
        /// ungültig", seems to be a slip in the translation of this.)
        NullingUnplanned = 4,
        /// Stopped at a location that was not planned.
        StoppedUnplanned = 5,
        /// Braking towards HALT, or stopped in it.
        Halt = 6,
        /// Braking because of a REACTI or BREAK instruction.
        BrakingForBreak = 7,
        /// Stopped because of a REACTI or BREAK instruction.
        StoppedForBreak = 8,
        /// Braking because of a hardware fault or a panic stop.
        BrakingForFault = 9,
        /// Stopped because of a hardware fault or a panic stop.
        StoppedForFault = 10,
        /// Braking in reaction to a signal.
        BrakingForSignal = 11,
        /// Stopped in reaction to a signal.
        StoppedForSignal = 12,
        /// The arm is near the programmed position.
        NearTarget = 13,
    }
}

impl SegmentStatus {
    /// Returns whether the arm is braked or was stopped: HALT, REACTI or BREAK, a fault, a panic stop, a signal, or an
    /// unknown code. With other codes the arm follows a path, or the path has ended by itself, and ALTER moves the arm (our
    /// reading: the source does not state it).
    ///
    /// | code | the arm | |
    /// | --- | --- | --- |
    /// | 1, 2, 3, 4, 5, 13 | follows its path, or has come to its end | moves with ALTER |
    /// | 6 | HALT | is stopped |
    /// | 7, 8 | REACTI or BREAK | is stopped |
    /// | 9, 10 | hardware fault or panic stop | is stopped |
    /// | 11, 12 | a signal | is stopped |
    /// | 0, 14 and above | not named | is stopped |
    pub const fn is_stop(self) -> bool {
        match self {
            Self::NoneYet
            | Self::Normal
            | Self::Finished
            | Self::NullingUnplanned
            | Self::StoppedUnplanned
            | Self::NearTarget => false,
            Self::Halt
            | Self::BrakingForBreak
            | Self::StoppedForBreak
            | Self::BrakingForFault
            | Self::StoppedForFault
            | Self::BrakingForSignal
            | Self::StoppedForSignal
            | Self::Other(_) => true,
        }
    }
}

codes! {
    /// The code that starts the robot's exception subroutine (§3.3.2, §9.3). The program reads it as `ERROR(-1)`.
    Exception in 0..=255 => {
        /// Normal operation.
        None = 0,
        /// The source's program closes the gripper: CLOSEI.
        CloseGripper = 253,
        /// The source's program opens the gripper: OPENI.
        OpenGripper = 254,
    }
}

/// The host's answer to a start message (§3.3.1). The only code with a closed list: any other byte is an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum StartCode {
    /// 00: the host is ready for ALTER.
    Accept,
    /// 01: the start message was corrupt and is to be repeated.
    Repeat,
    /// FF (−1): the host refuses ALTER; VAL II ends its program with an error.
    Refuse,
}

impl StartCode {
    pub(crate) fn from_byte(byte: u8) -> Option<Self> {
        match byte {
            0x00 => Some(Self::Accept),
            0x01 => Some(Self::Repeat),
            0xFF => Some(Self::Refuse),
            _ => None,
        }
    }
}

impl From<StartCode> for u8 {
    fn from(code: StartCode) -> u8 {
        match code {
            StartCode::Accept => 0x00,
            StartCode::Repeat => 0x01,
            StartCode::Refuse => 0xFF,
        }
    }
}
