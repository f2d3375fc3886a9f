//! Orientations: W P R as the controller shows them, unit quaternions to calculate with.

use core::ops::Mul;

use libm::{asin, atan2, cos, fabs, sin, sqrt};

/// A unit quaternion: the orientation of the tool in the world frame.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Quaternion {
    /// The scalar part: the cosine of half the angle, −1 to 1.
    pub w: f64,
    /// The part along X, −1 to 1.
    pub x: f64,
    /// The part along Y, −1 to 1.
    pub y: f64,
    /// The part along Z, −1 to 1.
    pub z: f64,
}

impl Quaternion {
    /// No rotation.
    pub const IDENTITY: Self = Self { w: 1.0, x: 0.0, y: 0.0, z: 0.0 };

    /// Creates an orientation from W, P, R in degrees: turns about the fixed axes X, Y, Z in this order, `Rz(R)·Ry(P)·Rx(W)`
    /// (Fig. 8, footnote 4). The sign is as it comes; the background task makes `w` positive.
    pub fn from_wpr([w, p, r]: [f64; 3]) -> Self {
        let half = |degrees: f64| (sin(degrees.to_radians() / 2.0), cos(degrees.to_radians() / 2.0));
        let ((sr, cr), (sp, cp), (sy, cy)) = (half(w), half(p), half(r));
        Self {
            w: cr * cp * cy + sr * sp * sy,
            x: sr * cp * cy - cr * sp * sy,
            y: cr * sp * cy + sr * cp * sy,
            z: cr * cp * sy - sr * sp * cy,
        }
    }

    /// Returns W, P, R in degrees: W and R in -180..=180, P in -90..=90. At P = ±90° only their difference or sum is
    /// defined: R is 0 there, as controllers show it.
    pub fn to_wpr(self) -> [f64; 3] {
        let Self { w, x, y, z } = self;
        let sine = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0);
        // Within 0.001° of ±90° the other two are lost in rounding.
        if fabs(sine) > 1.0 - 1.5e-10 {
            let turn = 2.0 * atan2(x, w);
            let turn = atan2(sin(turn), cos(turn));
            return [turn.to_degrees(), if sine > 0.0 { 90.0 } else { -90.0 }, 0.0];
        }
        let about_x = atan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y));
        let about_z = atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z));
        [about_x.to_degrees(), asin(sine).to_degrees(), about_z.to_degrees()]
    }

    /// Creates an orientation from four numbers that are nearly a unit quaternion, such as the controller's registers; the
    /// identity if all are zero.
    pub fn normalised([w, x, y, z]: [f64; 4]) -> Self {
        let length = sqrt(w * w + x * x + y * y + z * z);
        if length > 0.0 && length.is_finite() {
            Self { w: w / length, x: x / length, y: y / length, z: z / length }
        } else {
            Self::IDENTITY
        }
    }

    /// Returns w, x, y, z.
    pub fn to_array(self) -> [f64; 4] {
        [self.w, self.x, self.y, self.z]
    }

    /// Returns the inverse rotation.
    #[must_use]
    pub fn conjugate(self) -> Self {
        Self { w: self.w, x: -self.x, y: -self.y, z: -self.z }
    }

    /// Returns the same orientation with the sign that is nearer to `other`, so that it follows another sample without a
    /// jump.
    #[must_use]
    pub fn near(self, other: Self) -> Self {
        let dot = self.w * other.w + self.x * other.x + self.y * other.y + self.z * other.z;
        if dot < 0.0 { Self { w: -self.w, x: -self.x, y: -self.y, z: -self.z } } else { self }
    }

    /// Returns the rotation as a vector: its direction is the axis, its length the angle in degrees, 180 at most (footnote 5).
    pub fn rotation_vector(self) -> [f64; 3] {
        let Self { w, x, y, z } = self.near(Self::IDENTITY);
        let sine = sqrt(x * x + y * y + z * z);
        // Below 1e-12 the angle is twice the sine to every digit.
        let scale = if sine > 1e-12 { 2.0 * atan2(sine, w) / sine } else { 2.0 };
        [x, y, z].map(|part| (part * scale).to_degrees())
    }

    /// Creates an orientation from a rotation vector in degrees.
    pub fn from_rotation_vector(vector: [f64; 3]) -> Self {
        let [x, y, z] = vector.map(f64::to_radians);
        let angle = sqrt(x * x + y * y + z * z);
        let scale = if angle > 1e-12 { sin(angle / 2.0) / angle } else { 0.5 };
        Self::normalised([cos(angle / 2.0), x * scale, y * scale, z * scale])
    }

    /// Returns the rotation from this orientation to the other, in the world frame, as a vector in degrees.
    pub fn rotation_to(self, other: Self) -> [f64; 3] {
        (other * self.conjugate()).rotation_vector()
    }

    /// Returns the angular velocity in the world frame, in degrees a second, by Euler's kinematic equations: `2·q̇·q*`.
    /// `rate` is the quaternion's derivative a second, such as the controller's `SPD_Q1` to `SPD_Q4` if they do not jump.
    pub fn angular_velocity_world(self, rate: [f64; 4]) -> [f64; 3] {
        let [w, x, y, z] = rate;
        let q = Self { w, x, y, z } * self.conjugate();
        [q.x, q.y, q.z].map(|part| (2.0 * part).to_degrees())
    }

    /// Returns the angular velocity in the tool's own frame, in degrees a second: `2·q*·q̇`.
    pub fn angular_velocity_body(self, rate: [f64; 4]) -> [f64; 3] {
        let [w, x, y, z] = rate;
        let q = self.conjugate() * Self { w, x, y, z };
        [q.x, q.y, q.z].map(|part| (2.0 * part).to_degrees())
    }

    /// Returns a vector of the tool's frame in the world frame.
    pub fn rotate(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let q = self * Self { w: 0.0, x, y, z } * self.conjugate();
        [q.x, q.y, q.z]
    }
}

impl Mul for Quaternion {
    type Output = Self;

    /// Returns the rotation by `other` first, then by this one, both about the world's axes.
    fn mul(self, other: Self) -> Self {
        let (a, b) = (self, other);
        Self {
            w: a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
            x: a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
            y: a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
            z: a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
        }
    }
}
