//! The background task of the source's Fig. 8, as the controller runs it.

use core::time::Duration;

use fanuc_hmi_modbus::TelemetryBlock;

/// The period of the background task (Fig. 8).
pub const PERIOD: Duration = Duration::from_millis(8);

/// The pose of the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// X, Y, Z in mm.
    pub position: [f64; 3],
    /// W, P, R in degrees about the fixed axes X, Y, Z.
    pub wpr: [f64; 3],
}

/// Runs the task once, line by line as in Fig. 8: single precision, Q1 made positive, differences over 0.008 s.
#[expect(clippy::cast_possible_truncation, reason = "the controller's registers are of single precision")]
pub fn background_task(counter: u32, pose: &Pose, before: &Pose) -> TelemetryBlock {
    let single = |values: [f64; 3]| values.map(|value| value as f32);
    let (position, position_before) = (single(pose.position), single(before.position));
    let (q, q_before) = (quaternion(pose.wpr), quaternion(before.wpr));
    let speed = |now: f32, before: f32| (now - before) / 0.008;
    let [x, y, z] = position;
    let [px, py, pz] = position_before;
    let mut quaternion_rate = q;
    for (rate, before) in quaternion_rate.iter_mut().zip(q_before) {
        *rate = speed(*rate, before);
    }
    TelemetryBlock {
        life_counter: counter,
        override_percent: 100,
        position,
        wpr: single(pose.wpr),
        quaternion: q,
        velocity: [speed(x, px), speed(y, py), speed(z, pz)],
        quaternion_rate,
    }
}

/// Lines 16 to 36: the quaternion of W, P, R, with its first part made positive.
#[expect(clippy::cast_possible_truncation, reason = "the controller's registers are of single precision")]
fn quaternion([w, p, r]: [f64; 3]) -> [f32; 4] {
    let ((sr, cr), (sp, cp), (sy, cy)) = (
        (w / 2.0).to_radians().sin_cos(),
        (p / 2.0).to_radians().sin_cos(),
        (r / 2.0).to_radians().sin_cos(),
    );
    let q = [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ];
    let [first, ..] = q;
    q.map(|part| if first.is_sign_negative() { -part } else { part } as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_task_computes_what_the_worked_values_say() {
        let pose = |wpr| Pose { position: [0.0; 3], wpr };
        let close = |wpr, expected: [f32; 4]| {
            let q = background_task(1, &pose(wpr), &pose(wpr)).quaternion;
            assert!(
                q.iter().zip(expected).all(|(q, expected)| (q - expected).abs() < 6e-8),
                "{wpr:?}: {q:?}"
            );
        };
        close([10.0, 20.0, 30.0], [0.951_548_5, 0.038_134_6, 0.189_307_9, 0.239_298_3]);
        // -0.5211695, -0.3779911, -0.6328781, 0.4300817 before the flip.
        close([-120.0, 80.0, 170.0], [0.521_169_5, 0.377_991_1, 0.632_878_1, -0.430_081_7]);
    }

    #[test]
    fn the_flip_makes_the_false_speed_that_the_source_computes() {
        let pose = |r| Pose { position: [0.0; 3], wpr: [0.0, 0.0, r] };
        let block = background_task(2, &pose(180.1), &pose(179.9));
        assert!((block.quaternion_rate[3] + 249.999).abs() < 0.01, "{:?}", block.quaternion_rate);
    }
}
