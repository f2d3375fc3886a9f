//! The joint angles at which an arm's tool is at a pose.

use core::f64::consts::PI;

use libm::{acos, atan2, cos, sin, sqrt};

use super::kinematics::{Arm, Pose};
use super::limits::Limits;

/// The posture of the arm: the letters of a position's `CONFIG`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Posture {
    /// `F` instead of `N`: J5 above zero.
    pub flip: bool,
    /// `U` instead of `D`: the elbow above the line from shoulder to wrist.
    pub up: bool,
    /// `T` instead of `B`: the wrist in front of J1's axis.
    pub front: bool,
}

/// A way to be at a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Solution {
    /// J1 to J6 in degrees, each within ±180, J3 from the horizontal.
    pub joints: [f64; 6],
    /// The posture of the arm.
    pub posture: Posture,
}

impl Arm {
    /// Returns every solution for a pose, except for whole turns: 8, 4 or none. `near` decides if J4 and J6 can share a
    /// turn, with J5 at zero. A wrist at most `slack` mm beyond the arm's reach, or inside of it, counts as at its border.
    pub fn inverse(
        &self,
        pose: &Pose,
        near: &[f64; 6],
        slack: f64,
    ) -> impl Iterator<Item = Solution> + use<> {
        let (arm, near) = (*self, *near);
        // The wrist's frame: back from the tool to the flange, and from that along its X.
        let back = arm.flange_turn().then(arm.tool).inverse();
        let wrist = pose.then(back).then(Pose::shift(-arm.flange, 0.0, 0.0));
        let folded = [(true, true), (true, false), (false, true), (false, false)];
        folded.into_iter().flat_map(move |(front, up)| {
            let solved = arm.fold(wrist.position, front, up, slack);
            [false, true].into_iter().filter_map(move |flip| {
                let [j1, j2, j3] = solved?;
                let [j4, j5, j6] = turn_wrist(&wrist, j1, j3, flip, near);
                let joints = [j1, j2, j3, j4, j5, j6].map(f64::to_degrees);
                Some(Solution { joints, posture: Posture { flip, up, front } })
            })
        })
    }

    /// Returns the solution for a pose that is nearest to `near`, whole turns included, within the joints' limits.
    pub fn nearest(&self, pose: &Pose, near: &[f64; 6], limits: &Limits) -> Option<[f64; 6]> {
        let far = |joints: &[f64; 6]| joints.iter().zip(near).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        self.inverse(pose, near, 0.0)
            .filter_map(|solution| limits.turned(solution.joints, near, 0.0))
            .min_by(|a, b| far(a).total_cmp(&far(b)))
    }

    /// Returns whether any joints within their limits bring the tool to a pose, within `slack` in mm and degrees.
    pub fn reaches(&self, pose: &Pose, limits: &Limits, slack: f64) -> bool {
        let zero = [0.0; 6];
        self.inverse(pose, &zero, slack).any(|found| limits.turned(found.joints, &zero, slack).is_some())
    }

    /// Returns J1 to J3, in radians, with the wrist's centre at this point.
    fn fold(&self, [x, y, z]: [f64; 3], front: bool, up: bool, slack: f64) -> Option<[f64; 3]> {
        let side = if front { 1.0 } else { -1.0 };
        let out = side * sqrt(x * x + y * y) - self.shoulder;
        let (upper, lower) = (self.upper_arm, sqrt(self.forearm * self.forearm + self.elbow * self.elbow));
        let reach = sqrt(out * out + z * z);
        let is_near = reach <= upper + lower + slack && reach >= (upper - lower).abs() - slack && reach > 0.0;
        if !is_near {
            return None;
        }
        let bend = (upper * upper + reach * reach - lower * lower) / (2.0 * upper * reach);
        let bend = acos(bend.clamp(-1.0, 1.0));
        // Seen from its back, the arm's other side is up.
        let elevation = atan2(z, out) + if up == front { bend } else { -bend };
        let (elbow_out, elbow_z) = (upper * cos(elevation), upper * sin(elevation));
        let forearm = atan2(z - elbow_z, out - elbow_out) - atan2(self.elbow, self.forearm);
        let j1 = atan2(side * y, side * x);
        Some([j1, wrap(PI / 2.0 - elevation), wrap(forearm)])
    }
}

impl Limits {
    /// Returns the joints with the whole turns that bring each nearest to `near` within its limits, within `slack` degrees.
    pub fn turned(&self, mut joints: [f64; 6], near: &[f64; 6], slack: f64) -> Option<[f64; 6]> {
        for ((joint, near), limit) in joints.iter_mut().zip(near).zip(self.joints) {
            let fits = |value: &f64| (limit.min - slack..=limit.max + slack).contains(value);
            let turns = ((near.min(limit.max).max(limit.min) - *joint) / 360.0).round();
            let values = [0.0, 1.0, -1.0].map(|more| *joint + (turns + more) * 360.0);
            let nearest = values.into_iter().filter(fits);
            *joint = nearest.min_by(|a, b| (a - near).abs().total_cmp(&(b - near).abs()))?;
        }
        Some(joints)
    }
}

/// Returns J4 to J6, in radians, that give the wrist its orientation.
fn turn_wrist(wrist: &Pose, j1: f64, j3: f64, flip: bool, near: [f64; 6]) -> [f64; 3] {
    let arm = Pose::turn(2, j1.to_degrees()).then(Pose::turn(1, -j3.to_degrees()));
    // Rx(a)·Ry(b)·Rx(c), column by column.
    let turned = |axis: [f64; 3]| {
        let [x, y, z] = axis;
        arm.inverse().then(*wrist).direction(Pose::shift(x, y, z))
    };
    let ([x0, x1, x2], [y0, y1, y2], [z0, ..]) =
        (turned([1.0, 0.0, 0.0]), turned([0.0, 1.0, 0.0]), turned([0.0, 0.0, 1.0]));
    let sine = sqrt(x1 * x1 + x2 * x2);
    if sine < 1e-9 {
        // The axes of J4 and J6 are one: J4 does not move.
        let [_, _, _, j4, ..] = near;
        let j4 = j4.to_radians();
        let both = if x0 > 0.0 { atan2(y2, y1) } else { -atan2(y2, y1) };
        let b = if x0 > 0.0 { 0.0 } else { PI };
        let sign = if x0 > 0.0 { 1.0 } else { -1.0 };
        return [wrap(j4), -b, wrap(-(both + sign * j4))];
    }
    let b = atan2(if flip { -sine } else { sine }, x0);
    let side = if flip { -1.0 } else { 1.0 };
    let (a, c) = (atan2(side * x1, -side * x2), atan2(side * y0, side * z0));
    [wrap(-a), wrap(-b), wrap(-c)]
}

/// Returns the same angle within ±180°.
fn wrap(angle: f64) -> f64 {
    if angle > PI {
        angle - 2.0 * PI
    } else if angle <= -PI {
        angle + 2.0 * PI
    } else {
        angle
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Kinematics;

    fn random(rng: &mut fastrand::Rng) -> [f64; 6] {
        [170.0, 90.0, 150.0, 175.0, 115.0, 175.0].map(|most: f64| (rng.f64() * 2.0 - 1.0) * most)
    }

    #[test]
    fn every_solution_is_at_the_pose_and_one_is_where_it_came_from() {
        let mut rng = fastrand::Rng::with_seed(1);
        let arm =
            Arm { tool: Pose::from_xyzwpr([10.0, -20.0, 150.0, 15.0, 30.0, -70.0]), ..Arm::LR_MATE_200ID };
        for _ in 0..2000 {
            let joints = random(&mut rng);
            let pose = arm.forward(&joints);
            let mut found = false;
            for solution in arm.inverse(&pose, &joints, 0.0) {
                let again = arm.forward(&solution.joints);
                assert!(again.distance(&pose) < 1e-6, "{joints:?} {solution:?}");
                let [x, y, z] = again.rotation_to(&pose);
                assert!(x.abs() + y.abs() + z.abs() < 1e-5, "{joints:?} {solution:?}");
                assert!(solution.joints.iter().all(|joint| joint.abs() <= 180.0), "{joints:?} {solution:?}");
                found |= solution.joints.iter().zip(joints).all(|(a, b)| (a - b).abs() < 1e-6);
            }
            assert!(found, "{joints:?}");
            let nearest = arm.nearest(&pose, &joints, &Limits::ANY).unwrap();
            assert!(nearest.iter().zip(joints).all(|(a, b)| (a - b).abs() < 1e-5), "{joints:?} {nearest:?}");
        }
    }

    #[test]
    fn with_j5_at_zero_j4_stays_and_j6_makes_up_for_it() {
        let arm = Arm::LR_MATE_200ID;
        let joints = [10.0, 20.0, -30.0, 40.0, 0.0, 25.0];
        let nearest = arm.nearest(&arm.forward(&joints), &[10.0, 20.0, -30.0, 50.0, 0.0, 15.0], &Limits::ANY);
        let nearest = nearest.unwrap();
        assert!((nearest[3] - 50.0).abs() < 1e-5 && (nearest[5] - 15.0).abs() < 1e-5, "{nearest:?}");
    }

    #[test]
    fn the_usual_pose_is_n_u_t_and_a_pose_beyond_the_arm_is_none() {
        let arm = Arm::LR_MATE_200ID;
        let home = [0.0, 0.0, 0.0, 0.0, -90.0, 0.0];
        let solution = arm
            .inverse(&arm.forward(&home), &home, 0.0)
            .find(|solution| solution.joints.iter().zip(home).all(|(a, b)| (a - b).abs() < 1e-6));
        let posture = Posture { flip: false, up: true, front: true };
        assert_eq!(solution.map(|solution| solution.posture), Some(posture));
        // 50 + 330 + 336.8 mm to the wrist's centre.
        let at = |x: f64| Pose::shift(x + 80.0, 0.0, 0.0).then(arm.flange_turn());
        assert!(arm.reaches(&at(716.0), &Limits::ANY, 0.0));
        assert!(!arm.reaches(&at(718.0), &Limits::ANY, 1.0));
        let mut limits = Limits::ANY;
        (limits.joints[0].min, limits.joints[0].max) = (-170.0, -90.0);
        (limits.joints[1].min, limits.joints[1].max) = (0.0, 145.0);
        assert!(!arm.reaches(&at(716.0), &limits, 1.0));
    }

    #[test]
    fn j4_stays_at_half_a_turn_and_j5_above_zero_is_f_alone() {
        let arm = Arm::LR_MATE_200ID;
        for (j4, j5) in [(180.0, 0.0), (180.0, 180.0), (40.0, 0.0), (40.0, 180.0)] {
            let joints = [10.0, 20.0, -30.0, j4, j5, 25.0];
            let pose = arm.forward(&joints);
            let found: Vec<_> = arm.inverse(&pose, &joints, 0.0).collect();
            assert!(found.iter().all(|one| one.posture.flip || one.joints[4] <= 0.0), "{found:?}");
            let stays = |one: &Solution| (one.joints[3] - j4).abs() < 1e-9 && one.joints[4].abs() == j5;
            assert!(found.iter().any(stays), "{found:?}");
            for one in found {
                let [x, y, z] = arm.forward(&one.joints).rotation_to(&pose);
                assert!(x.abs() + y.abs() + z.abs() < 1e-5, "{one:?}");
            }
        }
    }

    #[test]
    fn slack_widens_the_reach_at_both_of_its_borders() {
        // The forearm is 336.82 mm with its elbow: folded onto the upper arm, 6.82 mm are left.
        let arm = Arm { flange: 0.0, ..Arm::LR_MATE_200ID };
        let ways = |out: f64, slack: f64| {
            arm.inverse(&Pose::shift(50.0 + out, 0.0, 0.0), &[0.0; 6], slack)
                .filter(|solution| solution.posture.front)
                .count()
        };
        assert_eq!([ways(666.0, 0.0), ways(667.5, 0.0), ways(667.5, 1.0), ways(668.5, 1.0)], [4, 0, 4, 0]);
        assert_eq!([ways(7.0, 0.0), ways(6.0, 0.0), ways(6.0, 1.0), ways(5.0, 1.0)], [4, 0, 4, 0]);
        // With links of one length, the wrist in the shoulder does not determine J2.
        let even = Arm { shoulder: 0.0, elbow: 0.0, forearm: 330.0, ..arm };
        assert_eq!(even.inverse(&Pose::IDENTITY, &[0.0; 6], 1.0).count(), 0);
    }

    #[test]
    fn a_joint_is_turned_to_where_it_is_nearest_within_its_limits() {
        let mut limits = Limits::ANY;
        limits.joints[5].max = 300.0;
        let near = [0.0, 0.0, 0.0, 350.0, 0.0, 350.0];
        let turned = limits.turned([0.0, 0.0, 0.0, -5.0, 0.0, -5.0], &near, 0.0).unwrap();
        assert_eq!((turned[3], turned[5]), (355.0, -5.0));
        (limits.joints[0].min, limits.joints[0].max) = (1.0, 100.0);
        assert_eq!(limits.turned([0.0; 6], &near, 0.0), None);
    }

    #[test]
    fn a_joint_is_turned_as_often_as_it_takes() {
        let turned = |joint: f64, near: f64, most: f64, slack: f64| {
            let mut limits = Limits::ANY;
            (limits.joints[0].min, limits.joints[0].max) = (-most, most);
            Some(limits.turned([joint, 0.0, 0.0, 0.0, 0.0, 0.0], &[near, 0.0, 0.0, 0.0, 0.0, 0.0], slack)?[0])
        };
        assert_eq!(turned(3605.0, 10.0, 100.0, 0.0), Some(5.0));
        assert_eq!(turned(-3605.0, -10.0, 100.0, 0.0), Some(-5.0));
        assert_eq!(turned(5.0, -179.0, 360.0, 0.0), Some(-355.0), "176° away, and not 184°");
        // If the nearest turn is beyond the limits, as many turns back as necessary.
        for (joint, near, expected) in
            [(-170.0, 170.0, -170.0), (10.0, 400.0, 10.0), (10.0, 700.0, 10.0), (10.0, 1e6, 10.0)]
        {
            assert_eq!(turned(joint, near, 175.0, 0.0), Some(expected), "{joint} near {near}");
            assert_eq!(turned(-joint, -near, 175.0, 0.0), Some(-expected), "{joint} near {near}");
        }
        assert_eq!(
            [turned(10.0, 700.0, 360.0, 0.0), turned(10.0, 1000.0, 730.0, 0.0)],
            [Some(10.0), Some(730.0)]
        );
        // 200 is nearest, and out of its limits.
        assert_eq!(turned(3800.0, 190.0, 190.0, 0.0), Some(-160.0));
        assert_eq!(turned(5.0, 0.0, 4.5, 0.0), None);
        for joint in [5.0, -5.0] {
            assert_eq!(turned(joint, 0.0, 4.5, 0.7), Some(joint));
            assert_eq!(turned(joint, 0.0, 4.0, 0.7), None);
        }
    }
}
