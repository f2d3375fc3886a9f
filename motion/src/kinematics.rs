//! The pose of an arm's tool for its joint angles.

use libm::{atan2, cos, sin, sqrt};

use super::orientation::Quaternion;

/// The pose of the tool, from the six joints. Implement it for your robot; [`Arm`] covers the usual FANUC arm.
pub trait Kinematics {
    /// Returns the pose of the tool in the robot's world frame, from the joints in degrees as the controller shows them: J3
    /// from the horizontal, not from the upper arm (see [`Arm`]).
    fn forward(&self, joints: &[f64; 6]) -> Pose;
}

/// A position and an orientation; also the step from one frame to the next.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Pose {
    /// X, Y, Z in mm.
    pub position: [f64; 3],
    /// A unit quaternion: real part, then x, y, z.
    pub orientation: [f64; 4],
}

impl Pose {
    /// Nowhere from here.
    pub const IDENTITY: Self = Self { position: [0.0; 3], orientation: [1.0, 0.0, 0.0, 0.0] };

    /// Returns a step along the axes, without a turn.
    pub const fn shift(x: f64, y: f64, z: f64) -> Self {
        Self { position: [x, y, z], ..Self::IDENTITY }
    }

    /// Returns a turn about one of the axes (0 for x, 1 for y, 2 for z), without a step.
    pub fn turn(axis: usize, degrees: f64) -> Self {
        let half = degrees.to_radians() / 2.0;
        let mut orientation = [cos(half), 0.0, 0.0, 0.0];
        if let Some(part) = orientation.get_mut(axis + 1) {
            *part = sin(half);
        }
        Self { orientation, ..Self::IDENTITY }
    }

    /// Creates a pose from X, Y, Z in mm and W, P, R in degrees, as a tool frame or a Cartesian position gives them: turns
    /// about the fixed axes X, Y, Z in this order.
    pub fn from_xyzwpr([x, y, z, w, p, r]: [f64; 6]) -> Self {
        Self::shift(x, y, z).then(Self::turn(2, r)).then(Self::turn(1, p)).then(Self::turn(0, w))
    }

    /// Returns `next`, which is given in this frame, in the frame of this pose.
    #[must_use]
    pub fn then(self, next: Self) -> Self {
        let [x, y, z] = rotate(self.orientation, next.position);
        let [x0, y0, z0] = self.position;
        Self { position: [x0 + x, y0 + y, z0 + z], orientation: multiply(self.orientation, next.orientation) }
    }

    /// Returns the inverse pose: the outer frame as seen from this frame.
    #[must_use]
    pub fn inverse(self) -> Self {
        let [w, x, y, z] = self.orientation;
        let orientation = [w, -x, -y, -z];
        let [x, y, z] = rotate(orientation, self.position);
        Self { position: [-x, -y, -z], orientation }
    }

    /// Returns a step of this frame along the axes of the frame in which this one is given.
    pub fn direction(&self, step: Self) -> [f64; 3] {
        rotate(self.orientation, step.position)
    }

    /// Returns X, Y, Z in mm and W, P, R in degrees.
    pub fn to_xyzwpr(self) -> [f64; 6] {
        let ([x, y, z], [w, p, r]) = (self.position, Quaternion::normalised(self.orientation).to_wpr());
        [x, y, z, w, p, r]
    }

    /// Returns the distance of the positions, in mm.
    pub fn distance(&self, other: &Self) -> f64 {
        let ([x, y, z], [a, b, c]) = (self.position, other.position);
        sqrt((a - x) * (a - x) + (b - y) * (b - y) + (c - z) * (c - z))
    }

    /// Returns the rotation from this orientation to the other, as a vector in the world frame: its direction is the axis,
    /// its length the angle in degrees, 180 at most.
    pub fn rotation_to(&self, other: &Self) -> [f64; 3] {
        let [w, x, y, z] = self.orientation;
        let [mut w, x, y, z] = multiply(other.orientation, [w, -x, -y, -z]);
        let mut scale = 1.0;
        if w < 0.0 {
            (w, scale) = (-w, -1.0);
        }
        let sine = sqrt(x * x + y * y + z * z);
        if sine > 0.0 {
            scale *= (2.0 * atan2(sine, w)).to_degrees() / sine;
        }
        [x * scale, y * scale, z * scale]
    }
}

/// An arm with the usual six joints of a FANUC robot: a column, an upper arm, a forearm with an offset, a wrist whose
/// three axes meet.
///
/// J3 counts from the horizontal: tilting the upper arm (J2) leaves the forearm's direction unchanged. Controllers show and
/// accept J3 in this form; the source's listing agrees (J3 + J5 is 90.000 for every J2, with the tool upright). Programs
/// that count J3 from the upper arm convert by [`Trajectory::from_upper_arm`](super::Trajectory::from_upper_arm).
///
/// The origin of the world frame is on the axis of J1 at the height of J2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Arm {
    /// From the axis of J1 to the axis of J2, horizontally, in mm.
    pub shoulder: f64,
    /// From J2 to J3, in mm.
    pub upper_arm: f64,
    /// From J3 up to the axis of J4, with the forearm level, in mm.
    pub elbow: f64,
    /// From J3 to the wrist's centre along the forearm, in mm.
    pub forearm: f64,
    /// From the wrist's centre to the flange, in mm.
    pub flange: f64,
    /// The tool's frame, seen from the flange: UTOOL.
    pub tool: Pose,
}

impl Arm {
    /// The LR Mate 200iD with its reach of 717 mm, without a tool. The dimensions are those of FANUC's data sheet and
    /// of the public models made from it (50, 330, 35, 335 and 80 mm); tests compare with poses that others published.
    pub const LR_MATE_200ID: Self = Self {
        shoulder: 50.0,
        upper_arm: 330.0,
        elbow: 35.0,
        forearm: 335.0,
        flange: 80.0,
        tool: Pose::IDENTITY,
    };

    /// Returns the orientation of the flange with every joint at zero: it points along X, with its own x up: W 180, P -90, R
    /// 0.
    pub(super) fn flange_turn(&self) -> Pose {
        Pose::turn(1, -90.0).then(Pose::turn(0, 180.0))
    }
}

impl Kinematics for Arm {
    fn forward(&self, joints: &[f64; 6]) -> Pose {
        const Y: usize = 1;
        let [j1, j2, j3, j4, j5, j6] = *joints;
        let upper_arm = Pose::turn(2, j1).then(Pose::shift(self.shoulder, 0.0, 0.0)).then(Pose::turn(Y, j2));
        let forearm = upper_arm
            .then(Pose::shift(0.0, 0.0, self.upper_arm))
            .then(Pose::turn(Y, -(j2 + j3)))
            .then(Pose::shift(self.forearm, 0.0, self.elbow));
        let wrist = forearm.then(Pose::turn(0, -j4)).then(Pose::turn(Y, -j5)).then(Pose::turn(0, -j6));
        wrist.then(Pose::shift(self.flange, 0.0, 0.0)).then(self.flange_turn()).then(self.tool)
    }
}

fn multiply(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    let ([aw, ax, ay, az], [bw, bx, by, bz]) = (a, b);
    [
        aw * bw - ax * bx - ay * by - az * bz,
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
    ]
}

fn rotate(q: [f64; 4], [x, y, z]: [f64; 3]) -> [f64; 3] {
    let [w, i, j, k] = q;
    let [_, x, y, z] = multiply(multiply(q, [0.0, x, y, z]), [w, -i, -j, -k]);
    [x, y, z]
}
