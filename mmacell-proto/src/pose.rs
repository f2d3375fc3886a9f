use crate::error::{DecodeError, EncodeError, Expected};
use crate::fields::{PLATFORM, ROBOT, Reader, Writer, coordinate_fits};
use crate::units::{Angle, Length};

/// The pose of one kind of device's axes. It determines the messages and their lengths.
pub trait Pose: Copy + Eq + core::hash::Hash + core::fmt::Debug + sealed::Axes {
    /// Returns the sum, axis by axis: the target of a relative motion. `None` if an axis leaves the range of its field.
    fn plus(self, by: Self) -> Option<Self>;

    /// Returns whether every axis fits its field.
    fn has_form(self) -> bool;

    /// Returns whether all axes are equal within `tolerance` units of its last digit: 1 µm, 0.1 mrad.
    fn is_near(self, other: Self, tolerance: u32) -> bool;
}

/// The robot: X, Y, Z and the rotation C (§4.1). In `serde`: `[mm, mm, mm, rad]`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct RobotPose {
    /// The position along X, in steps of 1 µm.
    pub x: Length,
    /// The position along Y, in steps of 1 µm.
    pub y: Length,
    /// The position along Z, in steps of 1 µm.
    pub z: Length,
    /// The rotation about Z, in steps of 0.1 mrad.
    pub c: Angle,
}

/// The orientation platform: the rotations A and B (§4.1). In `serde`: `[rad, rad]`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub struct PlatformPose {
    /// The first rotation, in steps of 0.1 mrad.
    pub a: Angle,
    /// The second rotation, in steps of 0.1 mrad.
    pub b: Angle,
}

/// A device without axes: vision or gripper with a controller of its own, or the conditioning system, for which the source
/// does not define commands. There is no such pose, so there is no motion and no status.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum NoPose {}

#[cfg(feature = "defmt")]
impl defmt::Format for NoPose {
    fn format(&self, _: defmt::Formatter<'_>) {
        match *self {}
    }
}

/// The pose of a device that is not known beforehand: four axes or two, by the length of the line. For passive listeners.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize), serde(untagged))]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
pub enum AnyPose {
    /// The pose of four axes.
    Robot(RobotPose),
    /// The pose of two axes.
    Platform(PlatformPose),
}

impl RobotPose {
    /// Every axis at 0.
    pub const ORIGIN: Self = Self::from_units([0; 4]);

    /// Creates a pose of millimetres and radians, each rounded to its last digit.
    pub fn from_mm_rad(x: f64, y: f64, z: f64, c: f64) -> Self {
        let [x, y, z] = [x, y, z].map(Length::from_mm);
        Self { x, y, z, c: Angle::from_rad(c) }
    }

    /// Returns the axes in units of their last digit: µm, µm, µm, 0.1 mrad.
    pub const fn units(self) -> [i32; 4] {
        [self.x.um(), self.y.um(), self.z.um(), self.c.tenths_mrad()]
    }

    /// Creates a pose of axes in units of their last digit.
    pub const fn from_units([x, y, z, c]: [i32; 4]) -> Self {
        let [x, y, z] = [Length::from_um(x), Length::from_um(y), Length::from_um(z)];
        Self { x, y, z, c: Angle::from_tenths_mrad(c) }
    }
}

impl PlatformPose {
    /// Every axis at 0.
    pub const ORIGIN: Self = Self::from_units([0; 2]);

    /// Creates a pose of radians, each rounded to its last digit.
    pub fn from_rad(a: f64, b: f64) -> Self {
        Self { a: Angle::from_rad(a), b: Angle::from_rad(b) }
    }

    /// Returns the axes in units of their last digit: 0.1 mrad.
    pub const fn units(self) -> [i32; 2] {
        [self.a.tenths_mrad(), self.b.tenths_mrad()]
    }

    /// Creates a pose of axes in units of their last digit.
    pub const fn from_units([a, b]: [i32; 2]) -> Self {
        Self { a: Angle::from_tenths_mrad(a), b: Angle::from_tenths_mrad(b) }
    }
}

impl Pose for RobotPose {
    fn has_form(self) -> bool {
        self.units().into_iter().all(coordinate_fits)
    }

    fn plus(self, by: Self) -> Option<Self> {
        sum(self.units(), by.units()).map(Self::from_units)
    }

    fn is_near(self, other: Self, tolerance: u32) -> bool {
        near(self.units(), other.units(), tolerance)
    }
}

impl Pose for PlatformPose {
    fn has_form(self) -> bool {
        self.units().into_iter().all(coordinate_fits)
    }

    fn plus(self, by: Self) -> Option<Self> {
        sum(self.units(), by.units()).map(Self::from_units)
    }

    fn is_near(self, other: Self, tolerance: u32) -> bool {
        near(self.units(), other.units(), tolerance)
    }
}

impl Pose for NoPose {
    fn has_form(self) -> bool {
        match self {}
    }

    fn plus(self, _: Self) -> Option<Self> {
        match self {}
    }

    fn is_near(self, _: Self, _: u32) -> bool {
        match self {}
    }
}

impl Pose for AnyPose {
    fn has_form(self) -> bool {
        match self {
            Self::Robot(pose) => pose.has_form(),
            Self::Platform(pose) => pose.has_form(),
        }
    }

    fn plus(self, by: Self) -> Option<Self> {
        match (self, by) {
            (Self::Robot(pose), Self::Robot(by)) => pose.plus(by).map(Self::Robot),
            (Self::Platform(pose), Self::Platform(by)) => pose.plus(by).map(Self::Platform),
            (Self::Robot(_), Self::Platform(_)) | (Self::Platform(_), Self::Robot(_)) => None,
        }
    }

    fn is_near(self, other: Self, tolerance: u32) -> bool {
        match (self, other) {
            (Self::Robot(pose), Self::Robot(other)) => pose.is_near(other, tolerance),
            (Self::Platform(pose), Self::Platform(other)) => pose.is_near(other, tolerance),
            (Self::Robot(_), Self::Platform(_)) | (Self::Platform(_), Self::Robot(_)) => false,
        }
    }
}

pub(crate) mod sealed {
    use super::{DecodeError, EncodeError, Reader, Writer};

    /// The fields of a pose on the wire.
    pub trait Axes: Sized {
        fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError>;
        fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError>;
        fn encoded_len(&self) -> usize;
    }
}

impl sealed::Axes for RobotPose {
    #[inline(always)]
    fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        reader.coordinates(&ROBOT).map(Self::from_units)
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.coordinates(&ROBOT, self.units())
    }

    fn encoded_len(&self) -> usize {
        4 * 8
    }
}

impl sealed::Axes for PlatformPose {
    #[inline(always)]
    fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        reader.coordinates(&PLATFORM).map(Self::from_units)
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        writer.coordinates(&PLATFORM, self.units())
    }

    fn encoded_len(&self) -> usize {
        2 * 8
    }
}

impl sealed::Axes for NoPose {
    fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        let (offset, expected) = (reader.offset(), Expected::NoAxes);
        Err(match reader.rest() {
            [] => DecodeError::Short { offset, expected },
            [found, ..] => DecodeError::Unexpected { offset, found: *found, expected },
        })
    }

    fn write(&self, _: &mut Writer<'_>) -> Result<(), EncodeError> {
        match *self {}
    }

    fn encoded_len(&self) -> usize {
        match *self {}
    }
}

impl sealed::Axes for AnyPose {
    /// Reads a pose. Four axes are 32 characters; two, with all that follows them in a status, are at most 31.
    fn read(reader: &mut Reader<'_>) -> Result<Self, DecodeError> {
        if reader.rest().len() >= 4 * 8 {
            RobotPose::read(reader).map(Self::Robot)
        } else {
            PlatformPose::read(reader).map(Self::Platform)
        }
    }

    fn write(&self, writer: &mut Writer<'_>) -> Result<(), EncodeError> {
        match self {
            Self::Robot(pose) => pose.write(writer),
            Self::Platform(pose) => pose.write(writer),
        }
    }

    fn encoded_len(&self) -> usize {
        match self {
            Self::Robot(pose) => pose.encoded_len(),
            Self::Platform(pose) => pose.encoded_len(),
        }
    }
}

fn sum<const N: usize>(mut pose: [i32; N], by: [i32; N]) -> Option<[i32; N]> {
    for (axis, by) in pose.iter_mut().zip(by) {
        *axis = axis.checked_add(by).filter(|sum| coordinate_fits(*sum))?;
    }
    Some(pose)
}

fn near<const N: usize>(pose: [i32; N], other: [i32; N], tolerance: u32) -> bool {
    pose.iter().zip(other).all(|(axis, other)| axis.abs_diff(other) <= tolerance)
}
