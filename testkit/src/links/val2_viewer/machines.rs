use val2_viewer::host::machine::HostMachine;
use val2_viewer::workstation::machine::WorkstationMachine;

use crate::model::adapt;

adapt!(HostMachine);
adapt!(WorkstationMachine);
