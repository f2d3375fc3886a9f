use isra_ball::ball::machine::BallMachine;
use isra_ball::host::machine::HostMachine;

use crate::model::adapt;

adapt!(HostMachine);
adapt!(BallMachine);
