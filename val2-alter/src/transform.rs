//! The 24 transformation bytes of a standard message: raw words, and what they may mean.

use crate::scale::{word, word_saturating};
use crate::{EncodeError, Pose};

/// The twelve transformation words as they stand on the wire, low byte first. The source says no more about them:
/// [`Transform::pose`] reads them by a [`Layout`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(transparent))]
pub struct Transform(pub [i16; 12]);

impl Transform {
    /// The place and attitude that the words give, by `layout`.
    pub fn pose(&self, layout: &Layout) -> Pose {
        let mut pose = Pose::IDENTITY;
        for (index, (row, column)) in layout.order.places().into_iter().enumerate() {
            let word = f64::from(self.0.get(index).copied().unwrap_or_default());
            match pose.column_mut(column) {
                Some(vector) if column < 3 => set(vector, row, word / layout.rotation_one),
                Some(vector) => set(vector, row, word / layout.per_mm),
                None => {}
            }
        }
        pose
    }

    /// The words of a pose, by `layout`. Refused when a coordinate is outside ±1024 mm (at 32 units a mm).
    pub fn from_pose(pose: &Pose, layout: &Layout) -> Result<Self, EncodeError> {
        let mut words = [0; 12];
        for (to, units) in words.iter_mut().zip(layout.units(pose)) {
            *to = word(units)?;
        }
        Ok(Self(words))
    }

    /// As [`Transform::from_pose`], but what is too far away stands at the end of its word.
    pub fn from_pose_saturating(pose: &Pose, layout: &Layout) -> Self {
        Self(layout.units(pose).map(word_saturating))
    }

    pub(crate) fn from_bytes(bytes: &[u8; 24]) -> Self {
        let mut words = [0; 12];
        let (pairs, _) = bytes.as_chunks::<2>();
        for (to, from) in words.iter_mut().zip(pairs) {
            *to = i16::from_le_bytes(*from);
        }
        Self(words)
    }

    pub(crate) fn to_bytes(self) -> [u8; 24] {
        let mut bytes = [0; 24];
        let (pairs, _) = bytes.as_chunks_mut::<2>();
        for (to, from) in pairs.iter_mut().zip(self.0) {
            *to = from.to_le_bytes();
        }
        bytes
    }
}

fn set(vector: &mut [f64; 3], row: usize, value: f64) {
    if let Some(element) = vector.get_mut(row) {
        *element = value;
    }
}

/// How the twelve words make a pose. Nobody has said; the default is the natural reading: percentages are Q14 and lengths
/// 1/32 mm elsewhere in the protocol, and VAL lists transformations by columns.
///
/// To find out on a live robot, compare [`Pose::orthonormality`] of each [`Layout::NAMED`] and move the arm along one axis:
/// the check tells where the position stands, but a rotation matrix and its transpose are equally orthonormal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Layout {
    /// The order of the words.
    pub order: Order,
    /// The word that is 1.0 in the rotation.
    pub rotation_one: f64,
    /// The units of a millimetre in the position.
    pub per_mm: f64,
}

impl Layout {
    /// n, o, a, p by columns; Q14 and 1/32 mm.
    pub const COLUMNS: Self = Self { order: Order::Columns, rotation_one: 16384.0, per_mm: 32.0 };

    /// The layouts worth trying, the default first.
    pub const NAMED: [(&'static str, Self); 4] = [
        ("columns n o a p", Self::COLUMNS),
        ("rows of [n o a p]", Self { order: Order::Rows, ..Self::COLUMNS }),
        ("p, then columns n o a", Self { order: Order::PositionThenColumns, ..Self::COLUMNS }),
        ("rows of [n o a], then p", Self { order: Order::RotationRowsThenPosition, ..Self::COLUMNS }),
    ];

    /// The twelve elements of a pose in units of their words.
    fn units(&self, pose: &Pose) -> [f64; 12] {
        self.order.places().map(|(row, column)| {
            let unit = if column < 3 { self.rotation_one } else { self.per_mm };
            pose.element(row, column) * unit
        })
    }
}

impl Default for Layout {
    fn default() -> Self {
        Self::COLUMNS
    }
}

/// The order of the twelve words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
#[non_exhaustive]
pub enum Order {
    /// nx ny nz, ox oy oz, ax ay az, px py pz.
    #[default]
    Columns,
    /// nx ox ax px, ny oy ay py, nz oz az pz.
    Rows,
    /// px py pz, nx ny nz, ox oy oz, ax ay az.
    PositionThenColumns,
    /// nx ox ax, ny oy ay, nz oz az, px py pz.
    RotationRowsThenPosition,
}

impl Order {
    /// The row (x, y, z) and column (n, o, a, p) of each word.
    fn places(self) -> [(usize, usize); 12] {
        core::array::from_fn(|word| match self {
            Self::Columns => (word % 3, word / 3),
            Self::Rows => (word / 4, word % 4),
            Self::PositionThenColumns => (word % 3, (word / 3 + 3) % 4),
            Self::RotationRowsThenPosition if word < 9 => (word / 3, word % 3),
            Self::RotationRowsThenPosition => (word - 9, 3),
        })
    }
}
