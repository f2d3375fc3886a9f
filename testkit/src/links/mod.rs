//! The adapters of every link to the shared tests: each end against any peer, as a system that the model explores.

pub mod fanuc_hmi_modbus;
pub mod isra_ball;
pub mod kawasaki_msg;
pub mod laser_eb90;
pub mod latch;
pub mod mmacell_proto;
pub mod val2_alter;
pub mod val2_viewer;
pub mod work_queue;

use crate::model::{Margin, Pair, Table};

/// Every pair of ends, each in a line.
pub const PAIRS: &[Pair] = &[
    latch::PAIR,
    fanuc_hmi_modbus::ANY_CLIENT,
    fanuc_hmi_modbus::ANY_SERVER,
    isra_ball::ANY_BALL,
    isra_ball::ANY_HOST,
    kawasaki_msg::TCP,
    kawasaki_msg::UDP,
    kawasaki_msg::ANY_PC,
    kawasaki_msg::ANY_ROBOT,
    laser_eb90::ANY_CONTROLLER,
    laser_eb90::ANY_HOST,
    mmacell_proto::ANY_DEVICE,
    mmacell_proto::ANY_CENTRAL,
    val2_alter::ANY_CONTROLLER,
    val2_alter::ANY_HOST,
    val2_viewer::ANY_WORKSTATION,
    val2_viewer::ANY_HOST,
    work_queue::PAIR,
];

/// The tables of every link's machines, and of the operator's latch.
pub const TABLES: &[&[Table]] = &[
    latch::TABLES,
    fanuc_hmi_modbus::TABLES,
    isra_ball::TABLES,
    kawasaki_msg::TABLES,
    laser_eb90::TABLES,
    mmacell_proto::TABLES,
    val2_alter::TABLES,
    val2_viewer::TABLES,
];

/// The assumptions of each link's ends about time.
pub const MARGINS: &[fn() -> Vec<Margin>] = &[
    latch::margins,
    fanuc_hmi_modbus::margins,
    isra_ball::margins,
    kawasaki_msg::margins,
    laser_eb90::margins,
    mmacell_proto::margins,
    val2_alter::margins,
    val2_viewer::margins,
];
