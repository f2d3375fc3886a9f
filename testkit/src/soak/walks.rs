//! The ends whose peers the model describes: each is walked at random over bytes. A job is a message, received or lost.

use fanuc_hmi_modbus::Framing::Tcp;

use super::Row;
use crate::links::fanuc_hmi_modbus::{self as modbus, RTU, RTU_OVER_TCP};
use crate::links::{isra_ball, kawasaki_msg, laser_eb90, mmacell_proto, val2_alter, val2_viewer};
use crate::model::walk;

/// One row: the link, the transport and the peer, of how many random messages the check passes one, and the system.
macro_rules! rows {
    ($($name:ident: $link:literal, $transport:literal, $one_in:expr, $system:expr;)*) => {$(
        pub(super) const $name: Row = Row {
            link: $link,
            transport: $transport,
            job: "messages",
            one_in: $one_in,
            session: |seed, log| walk(&$system, seed, log),
        };
    )*};
}

// A poll of the ball and a request of the viewer are one byte without a check; TCP corrupts nothing; the messages of
// the laser's host include the line's faults.
rows! {
    ANY_CONTROLLER: "val2-alter", "serial, any controller", None, val2_alter::any_controller(true);
    HOSTILE_CONTROLLER: "val2-alter", "serial, hostile controller", None, val2_alter::any_controller(false);
    ANY_HOST_OF_ALTER: "val2-alter", "serial, any host", None, val2_alter::any_host(true);
    HOSTILE_HOST_OF_ALTER: "val2-alter", "serial, hostile host", None, val2_alter::any_host(false);
    ANY_CONTROLLER_OF_LASER: "laser-eb90", "serial, any controller", Some(256), laser_eb90::any_controller(true, false);
    HOSTILE_CONTROLLER_OF_LASER: "laser-eb90", "serial, hostile controller", Some(256), laser_eb90::any_controller(false, false);
    ANY_HOST_OF_LASER: "laser-eb90", "serial, any host", None, laser_eb90::any_host(true);
    HOSTILE_HOST_OF_LASER: "laser-eb90", "serial, hostile host", None, laser_eb90::any_host(false);
    ANY_CLIENT: "fanuc-hmi-modbus", "tcp, any client", None, modbus::any_client(Tcp, true);
    HOSTILE_CLIENT: "fanuc-hmi-modbus", "tcp, hostile client", None, modbus::any_client(Tcp, false);
    ANY_CLIENT_RTU: "fanuc-hmi-modbus", "rtu, any client", None, modbus::any_client(RTU, true);
    HOSTILE_CLIENT_RTU: "fanuc-hmi-modbus", "rtu, hostile client", None, modbus::any_client(RTU, false);
    ANY_CLIENT_THROUGH: "fanuc-hmi-modbus", "rtu over tcp, any client", None, modbus::any_client(RTU_OVER_TCP, true);
    HOSTILE_CLIENT_THROUGH: "fanuc-hmi-modbus", "rtu over tcp, hostile client", None, modbus::any_client(RTU_OVER_TCP, false);
    ANY_SERVER: "fanuc-hmi-modbus", "tcp, any server", None, modbus::any_server(Tcp, true);
    HOSTILE_SERVER: "fanuc-hmi-modbus", "tcp, hostile server", None, modbus::any_server(Tcp, false);
    ANY_SERVER_RTU: "fanuc-hmi-modbus", "rtu, any server", None, modbus::any_server(RTU, true);
    HOSTILE_SERVER_RTU: "fanuc-hmi-modbus", "rtu, hostile server", None, modbus::any_server(RTU, false);
    ANY_SERVER_THROUGH: "fanuc-hmi-modbus", "rtu over tcp, any server", None, modbus::any_server(RTU_OVER_TCP, true);
    HOSTILE_SERVER_THROUGH: "fanuc-hmi-modbus", "rtu over tcp, hostile server", None, modbus::any_server(RTU_OVER_TCP, false);
    ANY_PC: "kawasaki-msg", "tcp, any pc", None, kawasaki_msg::any_pc(false);
    ANY_INSISTENT_PC: "kawasaki-msg", "tcp, any insistent pc", None, kawasaki_msg::any_pc(true);
    ANY_LATE_PC: "kawasaki-msg", "tcp, any late pc", None, kawasaki_msg::late_pc();
    HOSTILE_PC: "kawasaki-msg", "tcp, hostile pc", None, kawasaki_msg::hostile_pc(false);
    HOSTILE_PC_OVER_UDP: "kawasaki-msg", "udp, hostile pc", None, kawasaki_msg::hostile_pc(true);
    HOSTILE_ROBOT: "kawasaki-msg", "tcp, hostile robot", None, kawasaki_msg::hostile_robot();
    ANY_WORKSTATION: "val2-viewer", "serial, any workstation", None, val2_viewer::any_workstation(true);
    HOSTILE_WORKSTATION: "val2-viewer", "serial, hostile workstation", None, val2_viewer::any_workstation(false);
    ANY_HOST_OF_VIEWER: "val2-viewer", "serial, any host", Some(256), val2_viewer::any_host(true);
    HOSTILE_HOST_OF_VIEWER: "val2-viewer", "serial, hostile host", Some(256), val2_viewer::any_host(false);
    ANY_BALL: "isra-ball", "serial, any ball", Some(256), isra_ball::any_ball(true);
    HOSTILE_BALL: "isra-ball", "serial, hostile ball", Some(256), isra_ball::any_ball(false);
    ANY_HOST_OF_BALL: "isra-ball", "serial, any host", None, isra_ball::any_host(true);
    HOSTILE_HOST_OF_BALL: "isra-ball", "serial, hostile host", None, isra_ball::any_host(false);
    ANY_CENTRAL: "mmacell-proto", "tcp, any central", None, mmacell_proto::any_central(true);
    HOSTILE_CENTRAL: "mmacell-proto", "tcp, hostile central", None, mmacell_proto::any_central(false);
    ANY_DEVICE: "mmacell-proto", "tcp, any device", None, mmacell_proto::any_device(true);
    HOSTILE_DEVICE: "mmacell-proto", "tcp, hostile device", None, mmacell_proto::any_device(false);
}
