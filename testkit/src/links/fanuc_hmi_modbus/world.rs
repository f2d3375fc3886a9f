//! The times of the models, the configurations of both ends, and what holds for both.

use core::time::Duration;

use fanuc_hmi_modbus::{ClientConfig, Framing, ServerConfig};

pub(super) const TICK: Duration = Duration::from_millis(10);
pub(super) const UNIT: u8 = 1;
/// The ticks in which a unit executes a broadcast.
pub(super) const TURNAROUND: u8 = 2;

pub(super) const COLLISION: &str = "on a serial line nothing is sent while bytes arrive";

/// The framings, each with its name.
pub(super) const FRAMINGS: [(&str, Framing); 3] =
    [("tcp", Framing::Tcp), ("rtu", RTU), ("rtu over tcp", RTU_OVER_TCP)];
/// RTU on a serial line.
pub const RTU: Framing = Framing::Rtu { silence: TICK };
/// RTU frames through a TCP connection.
pub const RTU_OVER_TCP: Framing = Framing::RtuOverTcp { stall: TICK };

pub(super) fn client(framing: Framing) -> ClientConfig {
    let is_tcp = framing == Framing::Tcp;
    ClientConfig {
        framing,
        in_flight: if is_tcp { 2 } else { 1 },
        timeout: if is_tcp { TICK } else { 2 * TICK },
        settle: TICK,
        turnaround: TICK * u32::from(TURNAROUND),
        broadcast: !is_tcp,
        transactions: 4,
        ..ClientConfig::tcp()
    }
}

pub(super) fn server(framing: Framing) -> ServerConfig {
    ServerConfig {
        framing,
        unit: Some(UNIT),
        broadcast: true,
        frame_timeout: 2 * TICK,
        ..ServerConfig::tcp()
    }
}
