//! Every end may be moved to a thread of its own.

const fn moves<T: Send>() {}

#[test]
fn every_end_moves_between_threads() {
    moves::<robot_work_queue::WorkQueue<String, 3>>();
    moves::<robot_work_queue::Writer<'_, String>>();
    moves::<robot_work_queue::Reader<'_, String>>();
    moves::<kawasaki_msg::Pc<&[kawasaki_msg::Line]>>();
    moves::<kawasaki_msg::Robot<'_, kawasaki_msg::Line>>();
    moves::<val2_alter::Host>();
    moves::<val2_alter::Controller>();
    moves::<val2_viewer::Host>();
    moves::<val2_viewer::Workstation>();
    moves::<isra_ball::Host>();
    moves::<isra_ball::Ball>();
    moves::<fanuc_hmi_modbus::Client>();
    moves::<fanuc_hmi_modbus::Server<[u16; 4]>>();
    moves::<fanuc_ls::Program>();
    moves::<laser_eb90::Host>();
    moves::<laser_eb90::Controller<'_, String>>();
    moves::<mmacell_proto::Central<mmacell_proto::RobotPose>>();
    moves::<mmacell_proto::Device<mmacell_proto::RobotPose>>();
    moves::<mmacell_task::Task>();
}
