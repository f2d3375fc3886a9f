//! Plans motions one after the other: the arm's position at each time, the time at which the next motion may begin, and the
//! rounding of corners.
//!
//! A motion has a constant commanded speed and is smoothed by a moving average, as in controllers: it takes the time of its
//! path at that speed, plus the time of the average. If the next one begins before the end of the average, the two overlap,
//! and the corner between them is rounded. The exact behaviour of FANUC's own filters is not published.

use super::inverse::Posture;
use super::kinematics::{Arm, Kinematics, Pose};
use super::limits::Limits;
use super::spline::{SegmentTiming, Spline};

/// The position of an arm, and the motions that bring it elsewhere.
#[derive(Debug, Clone)]
pub struct Planner {
    arm: Arm,
    limits: Limits,
    /// The joints of the arm without the motions below.
    base: [f64; 6],
    /// The joints at the end of the last motion.
    target: [f64; 6],
    active: Vec<Segment>,
    /// The curve that the arm follows, and the time at which it has begun: no other motion is active.
    spline: Option<(f64, Spline)>,
    /// The joints that were shown last.
    shown: [f64; 6],
    /// The pose of the tool without the motions above, and the pose at the end of the last of them, if no arm limits
    /// it.
    anywhere: Option<(Pose, Pose)>,
}

/// The goal of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// The angles of J1 to J6, in degrees.
    Joints([f64; 6]),
    /// The tool's pose in the world frame; then the posture of the arm and the turns of J4, J5 and J6, `None` if they are not
    /// known.
    Pose(Pose, Option<(Posture, [i16; 3])>),
}

/// The interpolation between two positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PathKind {
    /// Every joint arrives at the same time.
    Joint,
    /// A straight line of the tool.
    Linear,
    /// An arc of the tool through this point: X, Y, Z in mm.
    Arc([f64; 3]),
}

/// The speed of a motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pace {
    /// A share of the joints' greatest speeds, above 0 to 1.
    Share(f64),
    /// The tool's speed in mm/s.
    Path(f64),
    /// The tool's rotation in degrees a second.
    Turn(f64),
    /// The time of the whole motion, in s.
    Time(f64),
}

/// A motion.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// The goal of the motion.
    pub goal: Goal,
    /// The path of the tool to the goal.
    pub way: PathKind,
    /// The speed of the motion.
    pub pace: Pace,
    /// The length of the moving average, in s: the time in which the arm gets its speed.
    pub ramp: f64,
    /// The share of the average for which the next motion need not wait, 0 to 1: 0 stops at the goal.
    pub blend: f64,
}

/// The reason that a motion is not possible.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MoveError {
    /// No joint angles bring the tool there.
    #[error("the robot cannot reach X {x:.1} Y {y:.1} Z {z:.1} mm in that orientation")]
    Unreachable {
        /// X of the goal, in mm.
        x: f64,
        /// Y of the goal, in mm.
        y: f64,
        /// Z of the goal, in mm.
        z: f64,
    },
    /// A joint would leave its range.
    #[error("J{joint} would be at {value:.1}°: its range is {min}° to {max}°")]
    Joint {
        /// The number of the joint, 1 to 6.
        joint: u8,
        /// The angle that the joint would have, in degrees.
        value: f64,
        /// The least angle of the joint, in degrees.
        min: f64,
        /// The greatest angle of the joint, in degrees.
        max: f64,
    },
    /// The three places of an arc are on one line.
    #[error("the points of the arc are on one line")]
    Arc,
}

#[derive(Debug, Clone, Copy)]
struct Segment {
    begin: f64,
    /// The time of the way at its speed.
    cruise: f64,
    ramp: f64,
    from: [f64; 6],
    to: [f64; 6],
    path: Path,
}

#[derive(Debug, Clone, Copy)]
enum Path {
    Joint,
    Linear { from: Pose, to: Pose },
    Arc { from: Pose, to: Pose, center: [f64; 3], turn: [f64; 3] },
}

/// The rotation about the tool that no motion exceeds, in degrees a second.
const FASTEST_TURN: f64 = 500.0;
/// The share of the first of two moving averages.
const FIRST_AVERAGE: f64 = 2.0 / 3.0;
/// The highest speed of a tool without an arm, in mm/s.
const FASTEST_WAY: f64 = 2000.0;
/// The number of pieces in which a way is examined.
const PIECES: u32 = 25;

impl Planner {
    /// Creates an arm at rest.
    pub fn new(arm: Arm, limits: Limits, joints: [f64; 6]) -> Self {
        let (active, spline) = (Vec::new(), None);
        Self { arm, limits, base: joints, target: joints, active, spline, shown: joints, anywhere: None }
    }

    /// Returns the same planner for a tool that goes anywhere: its paths are those of poses, regardless of the arm's reach.
    /// Joints are the nearest ones, if there are any.
    pub fn anywhere(mut self) -> Self {
        let here = self.arm.forward(&self.target);
        self.anywhere = Some((here, here));
        self
    }

    /// Returns the joints at the end of the last motion.
    pub fn target(&self) -> [f64; 6] {
        self.target
    }

    /// Returns the arm with its tool.
    pub fn arm(&self) -> Arm {
        self.arm
    }

    /// Changes the tool. The arm must be at rest.
    pub fn set_tool(&mut self, tool: Pose) {
        let change = self.arm.tool.inverse().then(tool);
        self.anywhere = self.anywhere.map(|(_, here)| (here.then(change), here.then(change)));
        self.arm.tool = tool;
    }

    /// Returns the tool's pose at a time that is not before the last requested one.
    pub fn pose(&mut self, now: f64) -> Pose {
        let joints = self.at(now);
        match self.anywhere {
            Some((base, _)) => self.pose_on_the_way(base, now),
            None => self.arm.forward(&joints),
        }
    }

    /// Ends every motion at the arm's current position.
    pub fn halt(&mut self, now: f64) {
        let (joints, here) = (self.at(now), self.pose(now));
        (self.base, self.target, self.shown) = (joints, joints, joints);
        self.anywhere = self.anywhere.map(|_| (here, here));
        self.active.clear();
        self.spline = None;
    }

    /// Adds a motion that begins at `now`: when the next one may begin, and when it has ended.
    ///
    /// # Errors
    /// The arm cannot do it; nothing has changed.
    pub fn add(&mut self, now: f64, motion: &Move) -> Result<(f64, f64), MoveError> {
        let from = self.target;
        let start = self.anywhere.map_or_else(|| self.arm.forward(&from), |(_, target)| target);
        let to = match self.anywhere {
            Some(_) => self.joints_of(&motion.goal, motion.way, &from).unwrap_or(from),
            None => self.joints_of(&motion.goal, motion.way, &from)?,
        };
        let path = match (motion.way, motion.goal) {
            (PathKind::Joint, _) if self.anywhere.is_none() => Path::Joint,
            (PathKind::Joint, goal) => Path::Linear { from: start, to: self.pose_of(&goal) },
            (PathKind::Linear, goal) => Path::Linear { from: start, to: self.pose_of(&goal) },
            (PathKind::Arc(via), goal) => arc(start, via, self.pose_of(&goal))?,
        };
        let mut segment = Segment { begin: now, cruise: 0.0, ramp: motion.ramp.max(1e-3), from, to, path };
        match &mut self.anywhere {
            Some((_, target)) => *target = segment.pose(&self.arm, 1.0),
            None => segment.to = self.follow(&segment)?,
        }
        segment.cruise = self.cruise(&segment, motion.pace).max(1e-3);
        let next = now + segment.cruise + segment.ramp * (1.0 - motion.blend.clamp(0.0, 1.0));
        let end = now + segment.cruise + segment.ramp;
        self.target = segment.to;
        self.active.push(segment);
        Ok((next, end))
    }

    /// Returns whether the tool goes [anywhere](Self::anywhere).
    pub fn goes_anywhere(&self) -> bool {
        self.anywhere.is_some()
    }

    /// Adds a curve through all goals, which begins at `now` with the arm at rest, and ends at rest: the times of the goals.
    /// Paces are those of straight lines, except that of [`Pace::Path`], which is the speed on the curve. A tool that goes
    /// anywhere follows none.
    ///
    /// # Errors
    /// The arm cannot reach a goal; nothing has changed.
    pub fn add_spline(&mut self, now: f64, goals: &[(Goal, Pace)]) -> Result<Vec<f64>, MoveError> {
        let (start, mut from, mut segments) = (self.at(now), self.target, Vec::new());
        for (goal, pace) in goals {
            let to = self.joints_of(goal, PathKind::Linear, &from)?;
            let path = Path::Linear { from: self.arm.forward(&from), to: self.pose_of(goal) };
            let line = Segment { begin: now, cruise: 0.0, ramp: 0.0, from, to, path };
            let segment = match pace {
                Pace::Path(speed) => SegmentTiming::Speed(speed.max(1e-3)),
                pace => SegmentTiming::Time(self.cruise(&line, *pace)),
            };
            segments.push((to, segment));
            from = to;
        }
        let spline = Spline::new(&self.arm, start, &segments);
        let times = spline.times().map(|time| now + time).collect();
        (self.base, self.target, self.spline) = (from, from, Some((now, spline)));
        Ok(times)
    }

    /// Returns the joints at a time that is not before the last requested one.
    pub fn at(&mut self, now: f64) -> [f64; 6] {
        if let Some((begin, spline)) = &self.spline {
            let seconds = now - begin;
            self.shown = spline.at(seconds);
            if spline.times().last().is_none_or(|end| seconds >= end) {
                self.spline = None;
            }
            return self.shown;
        }
        while let Some(first) = self.active.first().copied()
            && now >= first.begin + first.cruise + first.ramp
        {
            self.base = first.to;
            if let Some((base, _)) = &mut self.anywhere {
                *base = first.pose(&self.arm, 1.0);
            }
            self.active.remove(0);
        }
        self.shown = if self.active.iter().all(|segment| matches!(segment.path, Path::Joint)) {
            self.active.iter().fold(self.base, |joints, segment| {
                added(joints, segment.from, segment.to, segment.share(now))
            })
        } else {
            let start = self.anywhere.map_or_else(|| self.arm.forward(&self.base), |(base, _)| base);
            let pose = self.pose_on_the_way(start, now);
            // Between two paths of the arm there may be poses that it cannot reach: it waits at its current one.
            self.arm.nearest(&pose, &self.shown, &self.limits).unwrap_or(self.shown)
        };
        self.shown
    }

    fn pose_on_the_way(&self, start: Pose, now: f64) -> Pose {
        self.active.iter().fold(start, |pose, segment| {
            let (from, at) = (segment.pose(&self.arm, 0.0), segment.pose(&self.arm, segment.share(now)));
            moved(pose, from, at)
        })
    }

    /// Returns the joints of a goal, nearest to those from which the arm comes.
    fn joints_of(&self, goal: &Goal, way: PathKind, from: &[f64; 6]) -> Result<[f64; 6], MoveError> {
        let joints = match goal {
            Goal::Joints(joints) => *joints,
            Goal::Pose(pose, folded) => {
                let folded = folded.filter(|_| way == PathKind::Joint);
                let found = match folded {
                    Some((posture, turns)) => self.folded(pose, from, posture, turns),
                    None => self.arm.nearest(pose, from, &self.limits),
                };
                let [x, y, z] = pose.position;
                found.ok_or(MoveError::Unreachable { x, y, z })?
            }
        };
        for ((joint, value), limit) in (1..).zip(joints).zip(self.limits.joints) {
            if !(limit.min..=limit.max).contains(&value) {
                return Err(MoveError::Joint { joint, value, min: limit.min, max: limit.max });
            }
        }
        Ok(joints)
    }

    fn folded(&self, pose: &Pose, from: &[f64; 6], posture: Posture, turns: [i16; 3]) -> Option<[f64; 6]> {
        let mut found = self.arm.inverse(pose, from, 0.0).filter(|solution| solution.posture == posture);
        let near = |joints: [f64; 6]| {
            let [j1, j2, j3, j4, j5, j6] = joints;
            let [t4, t5, t6] = turns.map(|turns| 360.0 * f64::from(turns));
            [j1, j2, j3, j4 + t4, j5 + t5, j6 + t6]
        };
        found.find_map(|solution| self.limits.turned(solution.joints, &near(solution.joints), 0.0))
    }

    fn pose_of(&self, goal: &Goal) -> Pose {
        match goal {
            Goal::Joints(joints) => self.arm.forward(joints),
            Goal::Pose(pose, _) => *pose,
        }
    }

    /// Returns the joints at the end of a way of the tool: for each piece, those nearest to the previous ones.
    fn follow(&self, segment: &Segment) -> Result<[f64; 6], MoveError> {
        if matches!(segment.path, Path::Joint) {
            return Ok(segment.to);
        }
        let mut joints = segment.from;
        for piece in 1..=PIECES {
            let pose = segment.pose(&self.arm, f64::from(piece) / f64::from(PIECES));
            let [x, y, z] = pose.position;
            joints =
                self.arm.nearest(&pose, &joints, &self.limits).ok_or(MoveError::Unreachable { x, y, z })?;
        }
        Ok(joints)
    }

    /// Returns the time of the path at its speed.
    fn cruise(&self, segment: &Segment, pace: Pace) -> f64 {
        let (length, turn) = segment.length(&self.arm);
        let joints = segment.from.iter().zip(segment.to).zip(self.limits.joints);
        let fastest = joints.map(|((from, to), limit)| (to - from).abs() / limit.speed).fold(0.0, f64::max);
        match pace {
            // Without an arm, a share of a tool's limits.
            Pace::Share(share) if self.anywhere.is_some() => {
                (length / FASTEST_WAY).max(turn / FASTEST_TURN) / share.max(1e-4)
            }
            Pace::Share(share) => fastest / share.max(1e-4),
            Pace::Path(speed) => (length / speed.max(1e-3)).max(turn / FASTEST_TURN),
            Pace::Turn(speed) => turn / speed.max(1e-3),
            Pace::Time(time) => time,
        }
    }
}

impl Segment {
    /// Returns the share of the way that has passed at a time: a box of `cruise` under two moving averages of `ramp`
    /// together, integrated. With only one, a way that is shorter than the average would begin at its full speed.
    fn share(&self, now: f64) -> f64 {
        let (t, cruise, ramp) = (now - self.begin, self.cruise, self.ramp);
        if t >= cruise + ramp {
            return 1.0;
        }
        let (first, second) = (ramp * FIRST_AVERAGE, ramp * (1.0 - FIRST_AVERAGE));
        let cube = |t: f64| t.max(0.0).powi(3) / 6.0;
        let square = |t: f64| cube(t) - cube(t - second);
        let line = |t: f64| square(t) - square(t - first);
        ((line(t) - line(t - cruise)) / (cruise * first * second)).clamp(0.0, 1.0)
    }

    fn pose(&self, arm: &Arm, share: f64) -> Pose {
        match &self.path {
            Path::Joint => arm.forward(&added(self.from, self.from, self.to, share)),
            Path::Linear { from, to } => {
                let ([x, y, z], [a, b, c]) = (from.position, to.position);
                let position = [x + (a - x) * share, y + (b - y) * share, z + (c - z) * share];
                Pose { position, orientation: turned(*from, *to, share) }
            }
            Path::Arc { from, to, center, turn } => {
                let spoke = difference(from.position, *center);
                let [x, y, z] = rotation(turn.map(|part| part * share)).direction(shift(spoke));
                let [a, b, c] = *center;
                Pose { position: [a + x, b + y, c + z], orientation: turned(*from, *to, share) }
            }
        }
    }

    /// Returns the length in mm and in degrees.
    fn length(&self, arm: &Arm) -> (f64, f64) {
        let (mut length, mut turn) = (0.0, 0.0);
        for piece in 0..PIECES {
            let at = |piece: u32| self.pose(arm, f64::from(piece) / f64::from(PIECES));
            let (here, there) = (at(piece), at(piece + 1));
            let [x, y, z] = here.rotation_to(&there);
            length += here.distance(&there);
            turn += (x * x + y * y + z * z).sqrt();
        }
        (length, turn)
    }
}

/// Returns an arc from one pose through a point to another pose.
fn arc(from: Pose, via: [f64; 3], to: Pose) -> Result<Path, MoveError> {
    let (u, v) = (difference(via, from.position), difference(to.position, from.position));
    let normal = cross(u, v);
    let square = dot(normal, normal);
    // Less than a micrometre has no direction.
    let is_short = |side| dot(side, side) < 1e-6;
    if square <= 1e-6 * dot(u, u) * dot(v, v) || is_short(u) || is_short(v) {
        return Err(MoveError::Arc);
    }
    // The centre of the circle through the three.
    let (a, b) =
        (cross(normal, u).map(|part| part * dot(v, v)), cross(v, normal).map(|part| part * dot(u, u)));
    let [x, y, z] = from.position;
    let [dx, dy, dz] = [0, 1, 2]
        .map(|i| (b.get(i).copied().unwrap_or(0.0) + a.get(i).copied().unwrap_or(0.0)) / (2.0 * square));
    let center = [x + dx, y + dy, z + dz];
    let (start, end) = (difference(from.position, center), difference(to.position, center));
    let length = square.sqrt();
    let axis = normal.map(|part| part / length);
    let mut angle = dot(cross(start, end), axis).atan2(dot(start, end)).to_degrees();
    if angle <= 0.0 {
        angle += 360.0; // about this axis the via point comes first
    }
    Ok(Path::Arc { from, to, center, turn: axis.map(|part| part * angle) })
}

/// Returns a pose moved as from one pose to another.
fn moved(pose: Pose, from: Pose, to: Pose) -> Pose {
    let ([x, y, z], [a, b, c]) = (pose.position, difference(to.position, from.position));
    let orientation = rotation(from.rotation_to(&to)).then(pose).orientation;
    Pose { position: [x + a, y + b, z + c], orientation }
}

/// Returns the orientation on the way from one to another.
fn turned(from: Pose, to: Pose, share: f64) -> [f64; 4] {
    let turn = from.rotation_to(&to).map(|part| part * share);
    rotation(turn).then(from).orientation
}

/// Returns a turn by a rotation vector in degrees.
fn rotation(vector: [f64; 3]) -> Pose {
    let orientation = super::orientation::Quaternion::from_rotation_vector(vector).to_array();
    Pose { position: [0.0; 3], orientation }
}

fn shift([x, y, z]: [f64; 3]) -> Pose {
    Pose::shift(x, y, z)
}

fn added(mut joints: [f64; 6], from: [f64; 6], to: [f64; 6], share: f64) -> [f64; 6] {
    for ((joint, from), to) in joints.iter_mut().zip(from).zip(to) {
        *joint += (to - from) * share;
    }
    joints
}

fn difference([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    [a - x, b - y, c - z]
}

fn cross([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> [f64; 3] {
    [b * z - c * y, c * x - a * z, a * y - b * x]
}

fn dot([a, b, c]: [f64; 3], [x, y, z]: [f64; 3]) -> f64 {
    a * x + b * y + c * z
}

#[cfg(test)]
mod tests;
