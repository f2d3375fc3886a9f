use mmacell_proto::PlatformPose;
use mmacell_proto::central::machine::CentralMachine;
use mmacell_proto::device::machine::DeviceMachine;

use crate::model::Drawn;

impl Drawn for CentralMachine<PlatformPose> {}

impl Drawn for DeviceMachine<PlatformPose> {}
