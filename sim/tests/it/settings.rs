//! The settings of devices by name: a device's own stand before those of its session, and each is given to its field.

use cellwire_sim::mma::{MmaPlatform, MmaRobot, MotionFaults};
use cellwire_sim::puma::{ArmConfig, Layout, Order};
use cellwire_sim::robot_session::settings::{list, read};
use cellwire_sim::robot_session::spec::Configure;
use cellwire_sim::{Laser, Puma, TeachBall, Viewer};

fn names(config: impl Configure) -> Vec<String> {
    list(config).into_iter().map(|setting| setting.name).collect()
}

/// Asserts that the names of the first configuration are `own`, followed by those of the second.
fn has(config: impl Configure, own: &[&str], of_session: impl Configure) {
    let own = own.iter().map(|name| (*name).to_string());
    assert_eq!(names(config), own.chain(names(of_session)).collect::<Vec<_>>());
}

const MOTION: [&str; 4] = ["fail_every", "stall_every", "refuse_every", "refuse_code"];

#[test]
fn the_settings_of_a_device_are_its_own_and_those_of_its_session() {
    has(TeachBall::default(), &["baud"], TeachBall::default().config);
    has(Viewer::default(), &["baud"], Viewer::default().config);
    has(Laser::default(), &["baud", "queue", "execution"], Laser::default().config);
    assert_eq!(names(MotionFaults::default()), MOTION);
    let own = [&["speed"][..], &MOTION, &["mute_every", "drop_every"]].concat();
    has(MmaRobot::default(), &own, MmaRobot::default().config);
    has(MmaPlatform::default(), &own, MmaPlatform::default().config);
    let arm = [
        "polarity",
        "scale.per_mm",
        "scale.per_degree",
        "layout.order",
        "layout.rotation_one",
        "layout.per_mm",
        "home.x",
        "home.y",
        "home.z",
    ];
    assert_eq!(names(ArmConfig::default()), arm);
    let mut of_puma = names(Puma::default().config);
    of_puma.extend(["restart", "subroutine_time"].into_iter().chain(arm).map(String::from));
    assert_eq!(names(Puma::default()), of_puma);
}

/// Returns the arm with this start position, if that is valid.
fn arm(x: f64) -> Option<ArmConfig> {
    let given = serde_json::json!({ "home": { "x": x }, "layout": { "order": "rows" } });
    read("the arm", ArmConfig::default(), given.as_object()?).ok()
}

#[test]
fn an_arm_starts_within_the_reach_of_its_words() {
    for x in [-1023.0, 1023.0] {
        let ArmConfig { home, layout, .. } = arm(x).unwrap();
        assert_eq!((home.p[0], layout), (x, Layout { order: Order::Rows, ..Layout::COLUMNS }));
        assert_eq!(arm(x * 1.001), None);
    }
}
