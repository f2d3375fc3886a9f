//! A hand on the ball. Its movement depends on the time alone, so that every run can be repeated.

use core::f64::consts::PI;
use core::time::Duration;

use isra_ball::Keys;

/// The measurements of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Grip {
    /// Force along X, Y, Z.
    pub force: [i8; 3],
    /// Moment about X, Y, Z.
    pub moment: [i8; 3],
    /// The keys that are down.
    pub keys: Keys,
}

/// After this time the hand begins again.
pub const PERIOD: Duration = Duration::from_secs(7);

/// Returns the grip of a hand at a time: the hand leans on the ball and lets go suddenly, presses the keys of the gripper,
/// twists and turns back at once, and rests.
pub fn grip(now: Duration) -> Grip {
    let t = now.as_secs_f64() % PERIOD.as_secs_f64();
    let mut axes = [0.0; 6];
    let mut keys = Keys::NONE;
    match t {
        // Leans on the ball along X, swaying in Y, and lets go all at once.
        0.8..1.8 => {
            axes[0] = 110.0 * swell((t - 0.8) / 0.6);
            axes[1] = 40.0 * (4.0 * PI * (t - 0.8)).sin();
        }
        // Closes the gripper.
        2.2..2.35 => keys = keys.with(1),
        // Twists about Z and lifts a little, turns back at once, lets go.
        2.9..3.4 => {
            axes[2] = 30.0 * swell((t - 2.9) / 0.3);
            axes[5] = -90.0 * swell((t - 2.9) / 0.2);
        }
        3.4..3.8 => axes[5] = 90.0,
        // Knocks the ball against its stops in every axis, and lets go all at once.
        4.2..5.0 => axes = [127.0, -128.0, 90.0, -100.0, 60.0, 127.0],
        // Opens the gripper while it pushes: the interruption disarms, and the rest of the push moves nothing.
        5.4..6.4 => {
            axes[1] = -80.0 * swell((t - 5.4) / 0.4);
            if (5.8..5.95).contains(&t) {
                keys = keys.with(2);
            }
        }
        _ => {}
    }
    // Every other round the other way, so that the arm comes back.
    let way = if (now.as_secs() / PERIOD.as_secs()).is_multiple_of(2) { 1.0 } else { -1.0 };
    // The springs never stand quite still.
    let tremble = (2.0 * PI * 11.0 * t).sin().round();
    let [x, y, z, mx, my, mz] = axes.map(|axis| count(way * axis + tremble));
    Grip { force: [x, y, z], moment: [mx, my, mz], keys }
}

/// Returns a value that rises smoothly from 0 to 1, and stays 1.
fn swell(x: f64) -> f64 {
    (1.0 - (PI * x.clamp(0.0, 1.0)).cos()) / 2.0
}

#[expect(clippy::cast_possible_truncation, reason = "a float saturates when cast to an integer")]
fn count(force: f64) -> i8 {
    force.round() as i8
}
