//! Place and attitude of the tool, and how ALTER's increments add up to them.

use val2_alter::{AXES, CoordinateFrame, Scale};

/// Place and attitude: the columns n, o, a of a rotation, and a position in mm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// The tool's x axis in the reference frame (normal).
    pub n: [f64; 3],
    /// The tool's y axis (orientation).
    pub o: [f64; 3],
    /// The tool's z axis (approach).
    pub a: [f64; 3],
    /// The tool's origin, in mm.
    pub p: [f64; 3],
}

impl Pose {
    /// The reference frame itself.
    pub const IDENTITY: Self =
        Self { n: [1.0, 0.0, 0.0], o: [0.0, 1.0, 0.0], a: [0.0, 0.0, 1.0], p: [0.0; 3] };

    /// Returns the motion of one reply's values: a translation, and the rotation Rz·Ry·Rx (about the fixed x, then y,
    /// then z axis). The source does not state the sequence of the three rotations; for the small angles of a cycle
    /// it makes no difference.
    pub fn from_values(values: [i16; AXES], scale: &Scale) -> Self {
        let [x, y, z, rx, ry, rz] = values;
        let sin_cos = |word| {
            let radians = scale.degrees(word).to_radians();
            (f64::sin(radians), f64::cos(radians))
        };
        let ((sx, cx), (sy, cy), (sz, cz)) = (sin_cos(rx), sin_cos(ry), sin_cos(rz));
        Self {
            n: [cz * cy, sz * cy, -sy],
            o: [cz * sy * sx - sz * cx, sz * sy * sx + cz * cx, cy * sx],
            a: [cz * sy * cx + sz * sx, sz * sy * cx - cz * sx, cy * cx],
            p: [x, y, z].map(|word| scale.millimetres(word)),
        }
    }

    /// Returns the matrix product `self · other`: `other` is given in the frame of `self`.
    #[must_use]
    pub fn times(&self, other: &Self) -> Self {
        let p = self.turn(other.p);
        Self { n: self.turn(other.n), o: self.turn(other.o), a: self.turn(other.a), p: add(p, self.p) }
    }

    /// Returns the accumulated correction `self` after another increment `set`, in the way of the successor language (Brooks GPL,
    /// real-time modification): in World, `position = self + set; orientation = self · set`; in Tool, `set · self`.
    #[must_use]
    pub fn accumulated(&self, set: &Self, frame: CoordinateFrame) -> Self {
        let mut sum = match frame {
            CoordinateFrame::World => Self { p: add(self.p, set.p), ..self.times(set) },
            CoordinateFrame::Tool => set.times(self),
        };
        sum.orthonormalize();
        sum
    }

    /// Returns the pose of the program's path with an accumulated `correction`: in World the correction shifts the position and
    /// turns the tool about the world's axes, in Tool it is given in the tool's frame.
    #[must_use]
    pub fn corrected(&self, correction: &Self, frame: CoordinateFrame) -> Self {
        match frame {
            CoordinateFrame::World => Self { p: add(self.p, correction.p), ..correction.times(self) },
            CoordinateFrame::Tool => self.times(correction),
        }
    }

    /// Returns the deviation of n, o, a from a right-handed orthonormal frame: the largest of | |n|−1 |, | |o|−1 |, |
    /// |a|−1 | and the elements of n×o − a. Zero for a rotation; below about 0.0002 for one that was rounded to Q14.
    pub fn orthonormality(&self) -> f64 {
        let lengths = [self.n, self.o, self.a].map(|v| (length(v) - 1.0).abs());
        let [x, y, z] = cross(self.n, self.o);
        let handed = [x - self.a[0], y - self.a[1], z - self.a[2]].map(f64::abs);
        lengths.into_iter().chain(handed).fold(0.0, f64::max)
    }

    fn turn(&self, v: [f64; 3]) -> [f64; 3] {
        add(add(scaled(self.n, v[0]), scaled(self.o, v[1])), scaled(self.a, v[2]))
    }

    /// Removes the rounding errors of thousands of cycles.
    fn orthonormalize(&mut self) {
        self.n = scaled(self.n, 1.0 / length(self.n));
        self.o = add(self.o, scaled(self.n, -dot(self.n, self.o)));
        self.o = scaled(self.o, 1.0 / length(self.o));
        self.a = cross(self.n, self.o);
    }

    /// Returns row x, y, z of column n, o, a, p; zero outside.
    pub(super) fn element(&self, row: usize, column: usize) -> f64 {
        let columns = [self.n, self.o, self.a, self.p];
        columns.get(column).and_then(|vector| vector.get(row)).copied().unwrap_or_default()
    }

    pub(super) fn column_mut(&mut self, column: usize) -> Option<&mut [f64; 3]> {
        [&mut self.n, &mut self.o, &mut self.a, &mut self.p].into_iter().nth(column)
    }
}

impl Default for Pose {
    fn default() -> Self {
        Self::IDENTITY
    }
}

fn add(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

fn scaled(v: [f64; 3], by: f64) -> [f64; 3] {
    v.map(|x| x * by)
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn length(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}

fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}
