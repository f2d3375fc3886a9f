//! What `robot_session::Machine` says of times, for every machine; and their sizes.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]
#![cfg(feature = "links")]

use testkit::links;
use testkit::model::{Rows, check_times};

/// Its times are kept, and it has so many bytes at most.
fn check<R: Rows>(size: usize) {
    check_times::<R>();
    assert!(size_of::<R::Machine>() <= size, "{} bytes", size_of::<R::Machine>());
}

#[test]
fn isra_ball() {
    check::<links::isra_ball::rows::Host>(112);
    check::<links::isra_ball::rows::Ball>(2);
}

#[test]
fn val2_viewer() {
    check::<links::val2_viewer::rows::Host>(48);
    check::<links::val2_viewer::rows::Workstation>(48);
}

#[test]
fn kawasaki_msg() {
    check::<links::kawasaki_msg::rows::Pc>(160);
    check::<links::kawasaki_msg::rows::Robot>(240);
}

#[test]
fn val2_alter() {
    check::<links::val2_alter::rows::Host>(200);
    check::<links::val2_alter::rows::Controller>(100);
}

#[test]
fn laser_eb90() {
    check::<links::laser_eb90::rows::Host>(160);
    check::<links::laser_eb90::rows::Controller>(64);
}

#[test]
fn fanuc_hmi_modbus() {
    use links::fanuc_hmi_modbus::rows::{Client, Rtu, RtuOverTcp, Server, Tcp};
    check::<Client<Tcp>>(144);
    check::<Client<Rtu>>(144);
    check::<Client<RtuOverTcp>>(144);
    check::<Server<Tcp>>(24);
    check::<Server<Rtu>>(24);
    check::<Server<RtuOverTcp>>(24);
}

#[test]
fn mmacell_proto() {
    use links::mmacell_proto::rows::{Central, Device, Moved, Progress};
    check::<Central>(64);
    check::<Progress>(64);
    check::<Device>(44);
    check::<Moved>(44);
}

#[test]
fn latch() {
    check::<links::latch::rows::Operator>(40);
}
