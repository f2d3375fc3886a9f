use mmacell_proto::PlatformPose;
use mmacell_proto::central::machine::CentralMachine;
use mmacell_proto::device::machine::DeviceMachine;

use crate::model::adapt;

adapt!(CentralMachine<PlatformPose>);
adapt!(DeviceMachine<PlatformPose>);
