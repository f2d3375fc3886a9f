//! The configurations of both ends, by field.

use crate::settings::{self, ANY_TIME, Configure, SOME_TIME, Setting, Table};
use fanuc_hmi_modbus::{ClientConfig, Framing, WordOrder};

/// The frames of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Frames {
    /// With MBAP headers.
    #[default]
    Tcp,
    /// As on a serial line, through a TCP connection.
    Rtu,
}

/// How the link's bytes are shown.
#[derive(Debug, Clone, Copy, Default)]
pub struct ViewSettings {
    /// The frames.
    pub frames: Frames,
    /// Whether a reply of 37 registers is shown as the telemetry block.
    pub telemetry: bool,
    /// The order of the words of wide values.
    pub word_order: WordOrder,
}

impl ViewSettings {
    /// The framing of a stream without times.
    pub fn framing(&self) -> Framing {
        match self.frames {
            Frames::Tcp => Framing::Tcp,
            Frames::Rtu => Framing::RTU_OVER_TCP,
        }
    }
}

impl Configure for ViewSettings {
    fn configure(&mut self, table: &mut Table<'_>) {
        let Self { frames, telemetry, word_order } = self;
        self::frames(table, frames);
        let about = "show a reply of 37 registers as the telemetry block";
        table.choice("view", &[("registers", false), ("telemetry", true)], about, telemetry);
        self::word_order(table, word_order);
    }
}

/// A client with the framing that it has. The tool's clients ask one thing at a time, and have no place for a second request.
impl Configure for ClientConfig {
    fn configure(&mut self, table: &mut Table<'_>) {
        let about = "from a request to its reply";
        table.time("timeout", SOME_TIME, about, &mut self.timeout);
        table.flag("any_unit", "take a reply from another unit than was asked", &mut self.any_unit);
        let about =
            "unit 0 is a broadcast that nobody answers; in RTU frames it is unless this says otherwise";
        table.flag("broadcast", about, &mut self.broadcast);
        let about = "how long the units of a serial line get to carry out a broadcast; there the longest frame is added";
        table.time("turnaround", ANY_TIME, about, &mut self.turnaround);
        let about = "assumed: in RTU frames no reply comes later than this after its request has timed out";
        table.time("settle", ANY_TIME, about, &mut self.settle);
        match &mut self.framing {
            Framing::Tcp => {}
            Framing::Rtu { silence } => {
                table.time("silence", SOME_TIME, "on a serial line, the silence between two frames", silence)
            }
            Framing::RtuOverTcp { stall } => {
                let about = "in RTU over TCP, a frame is cut without a byte for so long";
                table.time("stall", SOME_TIME, about, stall)
            }
        }
    }
}

/// What can be set of a client, on every kind of port.
pub fn client_settings() -> Vec<Setting> {
    let mut settings = settings::list(ClientConfig::tcp());
    for config in [ClientConfig::rtu(19_200), ClientConfig::rtu_over_tcp()] {
        for setting in settings::list(config) {
            if settings.iter().all(|known| known.name != setting.name) {
                settings.push(setting);
            }
        }
    }
    settings
}

/// The setting `framing`.
pub fn frames(table: &mut Table<'_>, frames: &mut Frames) {
    let about = "with MBAP headers, or as on a serial line";
    table.choice("framing", &[("tcp", Frames::Tcp), ("rtu", Frames::Rtu)], about, frames);
}

/// The setting `word_order`.
pub fn word_order(table: &mut Table<'_>, order: &mut WordOrder) {
    let choices = [("low_first", WordOrder::LowFirst), ("high_first", WordOrder::HighFirst)];
    table.choice("word_order", &choices, "which register of a 32-bit value comes first", order);
}
