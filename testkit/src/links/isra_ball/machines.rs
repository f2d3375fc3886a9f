use isra_ball::ball::machine::BallMachine;
use isra_ball::host::machine::HostMachine;

use crate::model::Drawn;

impl Drawn for HostMachine {}

impl Drawn for BallMachine {}
