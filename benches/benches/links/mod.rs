//! The work of every link, and of the queue: a table and its functions in a file each. `budgets` counts every row, `codecs`
//! times those with a name.

mod fanuc_hmi_modbus;
mod fanuc_ls;
mod isra_ball;
mod kawasaki_msg;
mod laser_eb90;
mod mmacell_proto;
mod streams;
mod val2_alter;
mod val2_viewer;
mod work_queue;

pub(crate) const LINKS: &[benches::Link] = &[
    fanuc_hmi_modbus::LINK,
    fanuc_ls::LINK,
    isra_ball::LINK,
    kawasaki_msg::LINK,
    laser_eb90::LINK,
    mmacell_proto::LINK,
    val2_alter::LINK,
    val2_viewer::LINK,
    work_queue::LINK,
];
