use testkit::contract;
use val2_alter::{Decoder, Framing, HostMessage, RobotMessage};

const LINK: &str = "val2-alter";

pub fn decoder() {
    // A corrupt end mark takes the next message with it, and its last DLE may belong to the start mark after that.
    let framing = Framing::default();
    let (robot, host) = (super::frames(LINK, Some("robot")), super::frames(LINK, Some("host")));
    contract::decoder("val2-alter, from the robot", || Decoder::<RobotMessage>::new(framing), &robot, 2);
    contract::decoder("val2-alter, from the host", || Decoder::<HostMessage>::new(framing), &host, 2);
}
