//! The LR Mate 200iD's forward kinematics against poses that others published.

use cellwire_motion::{Arm, Kinematics, Pose};
use fanuc_ls::Program;

const ARM: Arm = Arm::LR_MATE_200ID;

/// Joints, the flange's z axis in the world, its position. From the public collection mattj23/lrmate-200id
/// (`test_cases/r30ib_forward_kinematics.json`), made from a model that its author compared with RoboDK and a real
/// robot.
const PUBLISHED: [([f64; 6], [f64; 3], [f64; 3]); 5] = [
    (
        [
            17.795304119777708,
            9.63529729650715,
            40.3284447668726,
            41.9839869496418,
            50.29966354151829,
            53.881649348808025,
        ],
        [-0.04604114189296839, 0.5257503094005371, 0.8493920328201997],
        [318.11589386239353, 145.34934793767331, 636.7796296820055],
    ),
    (
        [
            20.63796843683733,
            43.1397243310845,
            55.05694273319494,
            29.665779715975674,
            13.775742025969212,
            2.2083197495325146,
        ],
        [0.32032289669995495, 0.24658190018282927, 0.914653272203175],
        [436.2966556321629, 174.39823366682805, 608.6228601543556],
    ),
    (
        [
            41.91594587983654,
            59.778440136944376,
            11.905550466812873,
            19.526726322980927,
            19.742308831048405,
            5.871320638379727,
        ],
        [0.5610231581763718, 0.6553879543606517, 0.5056872998887456],
        [532.8210829205959, 490.4790517736791, 309.9161489920663],
    ),
    (
        [
            0.25094037855319273,
            31.61611215782868,
            28.340521466154172,
            58.76293305395247,
            47.84902544631862,
            35.65137130408036,
        ],
        [0.4053615798934864, 0.635682048621281, 0.6569553429320047],
        [533.6511404457935, 53.049798816780545, 523.4107591958352],
    ),
    (
        [
            16.33861187936946,
            51.58998823605767,
            2.407107051034585,
            52.036661160026775,
            48.612482747495484,
            31.471727525794652,
        ],
        [0.44888950190295596, 0.7479900833044366, 0.48888551866417357],
        [651.8093999653648, 240.3910925803878, 293.17377476512826],
    ),
];

/// The x axes of the same poses.
const PUBLISHED_X: [[f64; 3]; 5] = [
    [-0.42918435783060316, 0.7574045048077612, -0.4920764199699502],
    [-0.9409292785054759, 0.1946798810024597, 0.2770412185650949],
    [-0.6483462864176445, -0.03193035175811393, 0.7606757164028921],
    [-0.43125207153275025, 0.7666302244493083, -0.47570973267268213],
    [-0.8263106473960147, 0.5557250755648823, -0.09154427556316591],
];

fn close(found: [f64; 3], expected: [f64; 3], within: f64) {
    let far = found.iter().zip(expected).any(|(a, b)| (a - b).abs() > within);
    assert!(!far, "found {found:?}, expected {expected:?}");
}

/// Returns an axis of the flange in the world: the direction of a step of 1 mm along it.
fn axis(pose: Pose, step: Pose) -> [f64; 3] {
    let (to, from) = (pose.then(step).position, pose.position);
    [to[0] - from[0], to[1] - from[1], to[2] - from[2]]
}

#[test]
fn the_arm_reaches_the_published_poses() {
    for ((joints, z, position), x) in PUBLISHED.iter().zip(PUBLISHED_X) {
        let pose = ARM.forward(joints);
        close(pose.position, *position, 1e-6);
        close(axis(pose, Pose::shift(0.0, 0.0, 1.0)), *z, 1e-9);
        close(axis(pose, Pose::shift(1.0, 0.0, 0.0)), x, 1e-9);
    }
}

#[test]
fn the_zero_pose_and_the_reach_are_those_of_the_data_sheet() {
    let zero = ARM.forward(&[0.0; 6]);
    close(zero.position, [465.0, 0.0, 365.0], 1e-9);
    close(axis(zero, Pose::shift(0.0, 0.0, 1.0)), [1.0, 0.0, 0.0], 1e-12);
    close(axis(zero, Pose::shift(1.0, 0.0, 0.0)), [0.0, 0.0, 1.0], 1e-12);
    // 717 mm is the reach of the wrist's centre with the arm stretched: J2 level, the elbow's offset in line.
    let lift = -(35.0f64 / 335.0).atan().to_degrees();
    let wrist = Arm { flange: 0.0, ..ARM }.forward(&[0.0, 90.0, lift, 0.0, 0.0, 0.0]);
    assert!((wrist.position[0] - 716.8).abs() < 0.1, "{wrist:?}");
}

/// The first pose of the source's listing holds the tool upright: J3 + J5 is 90.000 there, whatever J2 is. That is so
/// only when J3 counts from the horizontal.
#[test]
fn the_sources_listing_counts_j3_from_the_horizontal() {
    let path = format!("{}/../reference/ls/figure-4.ls", env!("CARGO_MANIFEST_DIR"));
    let program = Program::decode(&std::fs::read_to_string(path).unwrap()).unwrap();
    let joints = program.position(1).unwrap().joints().unwrap();
    close(axis(ARM.forward(&joints), Pose::shift(0.0, 0.0, 1.0)), [0.0, 0.0, 1.0], 1e-9);
    let mut from_upper_arm = joints;
    from_upper_arm[2] -= joints[1];
    assert!(axis(ARM.forward(&from_upper_arm), Pose::shift(0.0, 0.0, 1.0))[2] < 0.99);
}

#[test]
fn a_tool_moves_with_the_flange() {
    let tool = Pose::shift(10.0, 20.0, 30.0).then(Pose::turn(2, 90.0));
    let joints = PUBLISHED[0].0;
    let flange = ARM.forward(&joints);
    let tip = Arm { tool, ..ARM }.forward(&joints);
    assert!((flange.distance(&tip) - 1400.0f64.sqrt()).abs() < 1e-9);
    let [x, y, z] = flange.rotation_to(&tip);
    close([x, y, z], axis(flange, Pose::shift(0.0, 0.0, 90.0)), 1e-9);
}

#[test]
fn w_p_r_turn_about_fixed_axes_x_first() {
    // The zero pose as controllers show it.
    let shown = Pose::from_xyzwpr([465.0, 0.0, 365.0, 180.0, -90.0, 0.0]);
    close(shown.rotation_to(&ARM.forward(&[0.0; 6])), [0.0; 3], 1e-9);
    let [w, x, y, z] = Pose::from_xyzwpr([0.0, 0.0, 0.0, 10.0, 20.0, 30.0]).orientation;
    assert!((w - 0.951_548_5).abs() < 5e-8);
    close([x, y, z], [0.038_134_6, 0.189_307_9, 0.239_298_3], 5e-8);
}

#[test]
fn a_pose_shows_the_six_numbers_that_it_was_made_of() {
    for shown in [[465.0, -1.0, 365.0, 10.0, 20.0, 30.0], [0.0, 2.0, -3.0, -170.0, -80.0, 175.0]] {
        let found = Pose::from_xyzwpr(shown).to_xyzwpr();
        assert!(found.iter().zip(shown).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}, expected {shown:?}");
    }
}

#[test]
fn rotation_vectors_name_the_shorter_way() {
    let turned = |degrees| Pose::IDENTITY.rotation_to(&Pose::turn(1, degrees));
    close(turned(0.0), [0.0; 3], 0.0);
    close(turned(1e-6), [0.0, 1e-6, 0.0], 1e-15);
    close(turned(179.0), [0.0, 179.0, 0.0], 1e-9);
    close(turned(181.0), [0.0, -179.0, 0.0], 1e-9);
    close(turned(360.0), [0.0; 3], 1e-9);
    let half = Pose { orientation: [0.0, 0.0, 1.0, 0.0], ..Pose::IDENTITY };
    close(Pose::IDENTITY.rotation_to(&half), [0.0, 180.0, 0.0], 1e-9);
}
