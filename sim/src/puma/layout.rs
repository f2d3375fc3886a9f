//! The possible meanings of the twelve transformation words.

use val2_alter::Transform;

use super::pose::Pose;

/// The layout of the pose in the twelve words. It is not documented; the default is the natural reading: percentages
/// are Q14 and lengths 1/32 mm elsewhere in the protocol, and VAL lists transformations by columns.
///
/// To determine the layout on a live robot, compare [`Pose::orthonormality`] of each [`Layout::NAMED`] and move the arm
/// along one axis: the check shows the words of the position, but a rotation matrix and its transpose are equally
/// orthonormal.
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

    /// Returns the position and attitude in the words.
    pub fn pose(&self, words: &Transform) -> Pose {
        let mut pose = Pose::IDENTITY;
        for (index, (row, column)) in self.order.places().into_iter().enumerate() {
            let word = f64::from(words.0.get(index).copied().unwrap_or_default());
            match pose.column_mut(column) {
                Some(vector) if column < 3 => set(vector, row, word / self.rotation_one),
                Some(vector) => set(vector, row, word / self.per_mm),
                None => {}
            }
        }
        pose
    }

    /// Returns the words of a pose; a value that is too large becomes the end of its word.
    #[expect(
        clippy::cast_possible_truncation,
        reason = "a float saturates when cast to an integer, and NaN gives 0"
    )]
    pub fn words(&self, pose: &Pose) -> Transform {
        Transform(self.units(pose).map(|units| units.round() as i16))
    }

    /// Returns the twelve elements of a pose in units of their words.
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
    /// Returns the row (x, y, z) and column (n, o, a, p) of each word.
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

fn set(vector: &mut [f64; 3], row: usize, value: f64) {
    if let Some(element) = vector.get_mut(row) {
        *element = value;
    }
}
