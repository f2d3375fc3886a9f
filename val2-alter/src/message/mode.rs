//! The mode word of the ALTER instruction (§3).

/// The five mode bits of `ALTER(channel, mode, subroutine, priority)`, as the start message carries them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(transparent))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct Mode(pub u8);

impl Mode {
    /// `ALTER(0, 22, …)` of the source's program with the gripper: non-cumulative, tool, transformations, inputs used.
    pub const NON_CUMULATIVE_22: Self = Self(22);
    /// `ALTER(0, 23)` of the source's program: cumulative, tool, transformations, inputs used.
    pub const CUMULATIVE_23: Self = Self(23);

    const CUMULATIVE: u8 = 0b0_0001;
    const FRAME: u8 = 0b0_0010;
    const TRANSFORM: u8 = 0b0_0100;
    const FROM_JOINTS: u8 = 0b0_1000;
    const USE_INPUTS: u8 = 0b1_0000;
    const NAMED: u8 = 0b1_1111;

    /// Returns bit 0: whether a value moves the arm *by* or *to* its amount (§3.1).
    pub const fn accumulation(self) -> Accumulation {
        if self.0 & Self::CUMULATIVE != 0 { Accumulation::Cumulative } else { Accumulation::NonCumulative }
    }

    /// Returns bit 1: the frame of the values. The source prints 0 for both frames, hence the `polarity`.
    pub const fn frame(self, polarity: Polarity) -> CoordinateFrame {
        match (self.0 & Self::FRAME != 0, polarity) {
            (false, Polarity::ToolIsOne) | (true, Polarity::WorldIsOne) => CoordinateFrame::World,
            (true, Polarity::ToolIsOne) | (false, Polarity::WorldIsOne) => CoordinateFrame::Tool,
        }
    }

    /// Returns bit 2: whether standard messages contain a transformation.
    pub const fn has_transform(self) -> bool {
        self.0 & Self::TRANSFORM != 0
    }

    /// Returns bit 3: whether the transformation is computed from the joint angles, not from the set point.
    pub const fn transform_from_joints(self) -> bool {
        self.0 & Self::FROM_JOINTS != 0
    }

    /// Returns bit 4: whether the host's values change the path; otherwise all but the exception code is ignored.
    pub const fn uses_inputs(self) -> bool {
        self.0 & Self::USE_INPUTS != 0
    }

    /// Returns whether the bits without a name in the source (5 to 7) are all zero.
    pub const fn is_named(self) -> bool {
        self.0 & !Self::NAMED == 0
    }

    /// Returns the same mode with bit 0 set or cleared.
    #[must_use]
    pub const fn with_accumulation(self, accumulation: Accumulation) -> Self {
        self.with(Self::CUMULATIVE, matches!(accumulation, Accumulation::Cumulative))
    }

    /// Returns the same mode with bit 1 set or cleared.
    #[must_use]
    pub const fn with_frame(self, frame: CoordinateFrame, polarity: Polarity) -> Self {
        let world = matches!(frame, CoordinateFrame::World);
        self.with(Self::FRAME, world == matches!(polarity, Polarity::WorldIsOne))
    }

    /// Returns the same mode with bit 2 set or cleared.
    #[must_use]
    pub const fn with_transform(self, on: bool) -> Self {
        self.with(Self::TRANSFORM, on)
    }

    /// Returns the same mode with bit 3 set or cleared.
    #[must_use]
    pub const fn with_transform_from_joints(self, on: bool) -> Self {
        self.with(Self::FROM_JOINTS, on)
    }

    /// Returns the same mode with bit 4 set or cleared.
    #[must_use]
    pub const fn with_inputs(self, on: bool) -> Self {
        self.with(Self::USE_INPUTS, on)
    }

    const fn with(self, bit: u8, on: bool) -> Self {
        Self(if on { self.0 | bit } else { self.0 & !bit })
    }
}

/// Mode bit 0 (§3.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Accumulation {
    /// A value moves the arm *to* an offset from the programmed path; zero is the way back to the path.
    NonCumulative,
    /// A value moves the arm *by* its amount; zero moves nothing.
    Cumulative,
}

/// The frame that values are given in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum CoordinateFrame {
    /// World coordinates, of the robot's base.
    World,
    /// Tool coordinates, of the gripper.
    Tool,
}

/// The polarity of mode bit 1. The source prints 0 for World and 0 for Tool. All its other rows list 0 first, and
/// World is listed first; the successor language V+ is remembered with the opposite polarity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Polarity {
    /// World = 0, Tool = 1.
    #[default]
    ToolIsOne,
    /// World = 1, Tool = 0.
    WorldIsOne,
}
