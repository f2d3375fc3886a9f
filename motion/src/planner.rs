//! Motions one after the other: where an arm is at each time, when the next motion may begin, and how a corner is rounded.
//!
//! A motion asks for a constant speed and is smoothed by a moving average, as controllers do: it takes the time of its way at its
//! speed, and the time of the average more. Where the next one begins before the average has run out, the two overlap, and the
//! corner between them is rounded. What FANUC's own filters do exactly is not published.

use super::inverse::Posture;
use super::kinematics::{Arm, Kinematics, Pose};
use super::limits::Limits;

/// Where an arm is, and the motions that bring it elsewhere.
#[derive(Debug, Clone)]
pub struct Planner {
    arm: Arm,
    limits: Limits,
    /// Where the arm is without the motions below.
    base: [f64; 6],
    /// Where the last of them ends.
    target: [f64; 6],
    active: Vec<Segment>,
    /// Where the arm was last.
    shown: [f64; 6],
}

/// Where a motion goes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Goal {
    /// Joint angles in degrees.
    Joints([f64; 6]),
    /// The tool's pose in the world frame, the arm folded so, if it is known, with the turns of J4, J5 and J6.
    Pose(Pose, Option<(Posture, [i16; 3])>),
}

/// The way there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Way {
    /// Every joint arrives at the same time.
    Joint,
    /// A straight line of the tool.
    Linear,
    /// An arc of the tool through this place, in mm.
    Arc([f64; 3]),
}

/// How fast.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pace {
    /// A share of the joints' greatest speeds.
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
    /// Where it goes.
    pub goal: Goal,
    /// The way there.
    pub way: Way,
    /// How fast.
    pub pace: Pace,
    /// How long the moving average is, in s: the time in which the arm gets its speed.
    pub ramp: f64,
    /// Which share of the average the next motion need not wait for: 0 stops at the goal.
    pub blend: f64,
}

/// Why a motion is none.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MoveError {
    /// No joint angles bring the tool there.
    #[error("the robot cannot reach X {x:.1} Y {y:.1} Z {z:.1} mm in that orientation")]
    #[allow(missing_docs, reason = "the place, in mm")]
    Unreachable { x: f64, y: f64, z: f64 },
    /// A joint would leave its range.
    #[error("J{joint} would be at {value:.1}°: its range is {min}° to {max}°")]
    #[allow(missing_docs, reason = "the joint, its angle and its range")]
    Joint { joint: u8, value: f64, min: f64, max: f64 },
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
/// How finely a way is looked at.
const PIECES: u32 = 25;

impl Planner {
    /// An arm at rest.
    pub fn new(arm: Arm, limits: Limits, joints: [f64; 6]) -> Self {
        Self { arm, limits, base: joints, target: joints, active: Vec::new(), shown: joints }
    }

    /// The joints where the last motion ends.
    pub fn target(&self) -> [f64; 6] {
        self.target
    }

    /// The arm with its tool.
    pub fn arm(&self) -> Arm {
        self.arm
    }

    /// Changes the tool. The arm must be at rest.
    pub fn set_tool(&mut self, tool: Pose) {
        self.arm.tool = tool;
    }

    /// Adds a motion that begins at `now`: when the next one may begin, and when it has ended.
    ///
    /// # Errors
    /// The arm cannot do it; nothing has changed.
    pub fn add(&mut self, now: f64, motion: &Move) -> Result<(f64, f64), MoveError> {
        let from = self.target;
        let start = self.arm.forward(&from);
        let to = self.joints_of(&motion.goal, motion.way, &from)?;
        let path = match (motion.way, motion.goal) {
            (Way::Joint, _) => Path::Joint,
            (Way::Linear, goal) => Path::Linear { from: start, to: self.pose_of(&goal) },
            (Way::Arc(via), goal) => arc(start, via, self.pose_of(&goal))?,
        };
        let mut segment = Segment { begin: now, cruise: 0.0, ramp: motion.ramp.max(1e-3), from, to, path };
        segment.to = self.follow(&segment)?;
        segment.cruise = self.cruise(&segment, motion.pace).max(1e-3);
        let next = now + segment.cruise + segment.ramp * (1.0 - motion.blend.clamp(0.0, 1.0));
        let end = now + segment.cruise + segment.ramp;
        self.target = segment.to;
        self.active.push(segment);
        Ok((next, end))
    }

    /// The joints at a time that is not before the last one asked for.
    pub fn at(&mut self, now: f64) -> [f64; 6] {
        while let Some(first) = self.active.first().copied()
            && now >= first.begin + first.cruise + first.ramp
        {
            self.base = if let (Path::Joint, true) = (first.path, self.active.len() > 1) {
                added(self.base, first.from, first.to, 1.0)
            } else {
                first.to
            };
            self.active.remove(0);
        }
        self.shown = if self.active.iter().all(|segment| matches!(segment.path, Path::Joint)) {
            self.active.iter().fold(self.base, |joints, segment| {
                added(joints, segment.from, segment.to, segment.share(now))
            })
        } else {
            let start = self.arm.forward(&self.base);
            let pose = self.active.iter().fold(start, |pose, segment| {
                let (from, at) = (segment.pose(&self.arm, 0.0), segment.pose(&self.arm, segment.share(now)));
                moved(pose, from, at)
            });
            // Between two ways that the arm can go it may have none: it waits where it is.
            self.arm.nearest(&pose, &self.shown, &self.limits).unwrap_or(self.shown)
        };
        self.shown
    }

    /// The joints that a goal has, those nearest to where the arm comes from.
    fn joints_of(&self, goal: &Goal, way: Way, from: &[f64; 6]) -> Result<[f64; 6], MoveError> {
        let joints = match goal {
            Goal::Joints(joints) => *joints,
            Goal::Pose(pose, folded) => {
                let folded = folded.filter(|_| way == Way::Joint);
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

    /// Where the joints are at the end of a way of the tool: each piece nearest to the one before.
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

    /// The time of the way at its speed.
    fn cruise(&self, segment: &Segment, pace: Pace) -> f64 {
        let (length, turn) = segment.length(&self.arm);
        let joints = segment.from.iter().zip(segment.to).zip(self.limits.joints);
        let fastest = joints.map(|((from, to), limit)| (to - from).abs() / limit.speed).fold(0.0, f64::max);
        match pace {
            Pace::Share(share) => fastest / share.max(1e-4),
            Pace::Path(speed) => (length / speed.max(1e-3)).max(turn / FASTEST_TURN),
            Pace::Turn(speed) => turn / speed.max(1e-3),
            Pace::Time(time) => time,
        }
    }
}

impl Segment {
    /// How much of the way lies behind at a time: a box of `cruise` under a moving average of `ramp`, integrated.
    fn share(&self, now: f64) -> f64 {
        let half_square = |t: f64| t.max(0.0).powi(2) / 2.0;
        let (t, cruise, ramp) = (now - self.begin, self.cruise, self.ramp);
        if t >= cruise + ramp {
            return 1.0;
        }
        let area = half_square(t) - half_square(t - cruise) - half_square(t - ramp);
        (area / (cruise * ramp)).clamp(0.0, 1.0)
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

    /// In mm and degrees.
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

/// An arc from one pose through a place to another pose.
fn arc(from: Pose, via: [f64; 3], to: Pose) -> Result<Path, MoveError> {
    let (u, v) = (difference(via, from.position), difference(to.position, from.position));
    let normal = cross(u, v);
    let square = dot(normal, normal);
    if square < 1e-6 * dot(u, u) * dot(v, v) || dot(v, v) < 1e-6 {
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

/// A pose moved as from one pose to another.
fn moved(pose: Pose, from: Pose, to: Pose) -> Pose {
    let ([x, y, z], [a, b, c]) = (pose.position, difference(to.position, from.position));
    let orientation = rotation(from.rotation_to(&to)).then(Pose { position: [0.0; 3], ..pose }).orientation;
    Pose { position: [x + a, y + b, z + c], orientation }
}

/// The orientation on the way from one to another.
fn turned(from: Pose, to: Pose, share: f64) -> [f64; 4] {
    let turn = from.rotation_to(&to).map(|part| part * share);
    rotation(turn).then(Pose { position: [0.0; 3], ..from }).orientation
}

/// A turn by a rotation vector in degrees.
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
mod tests {
    use super::*;

    const HOME: [f64; 6] = [0.0, 0.0, 0.0, 0.0, -90.0, 0.0];

    fn planner() -> Planner {
        Planner::new(Arm::LR_MATE_200ID, Limits::LR_MATE_200ID, HOME)
    }

    fn linear(planner: &Planner, x: f64, y: f64, blend: f64) -> Move {
        let home = planner.arm.forward(&HOME);
        let goal = Goal::Pose(Pose { position: [x, y, 200.0], ..home }, None);
        Move { goal, way: Way::Linear, pace: Pace::Path(100.0), ramp: 0.2, blend }
    }

    #[test]
    fn a_line_is_straight_has_its_speed_and_stops_at_its_end() {
        let mut planner = planner();
        let first = linear(&planner, 400.0, 0.0, 0.0);
        let (_, end) = planner.add(0.0, &first).unwrap();
        let second = linear(&planner, 400.0, 150.0, 0.0);
        let (next, stop) = planner.add(end, &second).unwrap();
        assert!(
            (next - stop).abs() < 1e-12 && (stop - end - 1.7).abs() < 1e-9,
            "150 mm at 100 mm/s and the ramp"
        );
        let arm = planner.arm;
        let mut at = |time: f64| arm.forward(&planner.at(time)).position;
        for k in 0..=170 {
            let [x, _, z] = at(end + f64::from(k) * 0.01);
            assert!((x - 400.0).abs() < 1e-6 && (z - 200.0).abs() < 1e-6, "{k}: {x} {z}");
        }
        let mut planner = self::planner();
        planner.add(0.0, &first).unwrap();
        planner.add(end, &second).unwrap();
        let mut at = |time: f64| arm.forward(&planner.at(time)).position;
        let (a, b) = (at(end + 0.8), at(end + 0.9));
        assert!((b[1] - a[1] - 10.0).abs() < 1e-6, "100 mm/s in the middle");
        assert!((at(stop)[1] - 150.0).abs() < 1e-6);
    }

    #[test]
    fn a_corner_is_rounded_the_more_the_less_the_next_motion_waits() {
        let corner = |blend: f64| {
            let mut planner = planner();
            let arm = planner.arm;
            let start = linear(&planner, 350.0, 0.0, 0.0);
            let (_, begin) = planner.add(0.0, &start).unwrap();
            let first = linear(&planner, 450.0, 0.0, blend);
            let (next, _) = planner.add(begin, &first).unwrap();
            let mut second = linear(&planner, 450.0, 100.0, 0.0);
            second.blend = 0.0;
            // What is added later may not be known before it begins.
            let mut nearest = f64::MAX;
            let mut slowest = f64::MAX;
            let mut before: Option<[f64; 3]> = None;
            let mut time = begin;
            let mut added = None;
            while added.is_none_or(|end| time < end) {
                if added.is_none() && time >= next {
                    added = Some(planner.add(next, &second).unwrap().1);
                }
                let [x, y, _] = arm.forward(&planner.at(time)).position;
                nearest = nearest.min((x - 450.0).hypot(y));
                if let (Some([bx, by, _]), true) = (before, time > begin + 0.3 && time < next + 0.5) {
                    slowest = slowest.min((x - bx).hypot(y - by) / 0.004);
                }
                before = Some([x, y, 0.0]);
                time += 0.004;
            }
            let [x, y, _] = arm.forward(&planner.at(time + 1.0)).position;
            assert!((x - 450.0).abs() < 1e-6 && (y - 100.0).abs() < 1e-6, "it arrives");
            (nearest, slowest)
        };
        let (fine, slow_fine) = corner(0.0);
        let (half, slow_half) = corner(0.5);
        let (full, slow_full) = corner(1.0);
        assert!(fine < 0.1 && half > 0.2 && full > 2.0 * half, "{fine} {half} {full} mm from the corner");
        assert!(
            slow_fine < 5.0 && slow_half > slow_fine && slow_full > 65.0,
            "{slow_fine} {slow_half} {slow_full} mm/s"
        );
        // 100 mm/s, 0.2 s: the corner is cut at a quarter of 20 mm on each side, 5/√2 mm away.
        assert!((full - 20.0 / 4.0 / 2f64.sqrt()).abs() < 0.3, "{full}");
    }

    #[test]
    fn joints_arrive_together_and_the_slowest_one_decides() {
        let mut planner = planner();
        let goal = [90.0, 19.0, 0.0, 0.0, -90.0, 0.0];
        let motion =
            Move { goal: Goal::Joints(goal), way: Way::Joint, pace: Pace::Share(0.5), ramp: 0.1, blend: 0.0 };
        let (_, end) = planner.add(0.0, &motion).unwrap();
        assert!((end - 0.5).abs() < 1e-9, "90° at half of 450°/s, and the ramp: {end}");
        let middle = planner.at(end / 2.0);
        assert!((middle[0] - 45.0).abs() < 1e-9 && (middle[1] - 9.5).abs() < 1e-9, "{middle:?}");
        assert_eq!(planner.at(end), goal);
        let far = Move { goal: Goal::Joints([171.0, 0.0, 0.0, 0.0, 0.0, 0.0]), ..motion };
        assert_eq!(
            planner.add(end, &far).unwrap_err().to_string(),
            "J1 would be at 171.0°: its range is -170° to 170°"
        );
        let pose = Pose { position: [900.0, 0.0, 0.0], ..Pose::IDENTITY };
        let out = Move { goal: Goal::Pose(pose, None), ..motion };
        assert!(matches!(planner.add(end, &out), Err(MoveError::Unreachable { .. })));
    }

    #[test]
    fn an_arc_goes_through_its_point() {
        let mut planner = planner();
        let home = planner.arm.forward(&HOME);
        let start = linear(&planner, 450.0, 0.0, 0.0);
        let (_, begin) = planner.add(0.0, &start).unwrap();
        // Around (400, 0): from 450 through (400, 50) to 350.
        let goal = Goal::Pose(Pose { position: [350.0, 0.0, 200.0], ..home }, None);
        let arc = Move { goal, way: Way::Arc([400.0, 50.0, 200.0]), ..start };
        let (_, end) = planner.add(begin, &arc).unwrap();
        let length = core::f64::consts::PI * 50.0;
        assert!((end - begin - length / 100.0 - 0.2).abs() < 0.01, "{}", end - begin);
        let arm = planner.arm;
        let mut highest: f64 = 0.0;
        for k in 0..=100 {
            let [x, y, _] = arm.forward(&planner.at(begin + (end - begin) * f64::from(k) / 100.0)).position;
            assert!(((x - 400.0).hypot(y) - 50.0).abs() < 1e-3, "{x} {y}");
            highest = highest.max(y);
        }
        assert!(highest > 49.9, "through the via point, not around the other side");
        let line = Move { goal, way: Way::Arc([450.0, 0.0, 200.0]), ..start };
        assert_eq!(planner.add(end, &line), Err(MoveError::Arc));
    }
}
