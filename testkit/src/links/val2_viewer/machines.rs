use val2_viewer::host::machine::HostMachine;
use val2_viewer::workstation::machine::WorkstationMachine;

use crate::model::Drawn;

impl Drawn for HostMachine {}

impl Drawn for WorkstationMachine {}
