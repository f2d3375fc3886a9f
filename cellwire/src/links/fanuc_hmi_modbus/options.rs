//! The settings of the link: its frames, the server and the client.

use std::time::Duration;

use fanuc_hmi_modbus::{ClientConfig, Framing, ServerConfig, WordOrder};
use serde_json::Value;

use crate::links::settings::{self, ANY_TIME, Configure, SOME_TIME, Setting, Table, json as json_text};

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

/// The simulated controller.
#[derive(Debug, Clone)]
pub struct FanucSettings {
    /// The frames, where it listens on TCP.
    pub frames: Frames,
    /// The unit that it is; `None`: every one on TCP, 1 in RTU frames.
    pub unit: Option<u8>,
    /// Whether unit 0 is a broadcast; `None`: in RTU frames.
    pub broadcast: Option<bool>,
    /// The line, in RTU on a serial line.
    pub baud: u32,
    /// The silence that ends a frame on a serial line; `None`: 3.5 characters.
    pub silence: Option<Duration>,
    /// The stall that ends a frame of RTU over TCP.
    pub stall: Duration,
    /// The order of the words of wide values.
    pub word_order: WordOrder,
    /// Telemetry that cannot be, and when: see [`Faults`](super::faults::Faults).
    pub faults: Option<String>,
    /// The program that the robot runs.
    pub program: ProgramSettings,
}

/// What the robot runs.
#[derive(Debug, Clone)]
pub struct ProgramSettings {
    /// The LS file; those that it calls are beside it.
    pub program: Option<String>,
    /// A listing of `$SNPX_ASG`.
    pub assignments: Option<String>,
    /// The robot's description, as `ls make` takes it.
    pub robot: Option<String>,
    /// J1 to J6 at the start, in degrees.
    pub joints: [f64; 6],
    /// See [`Inputs`](super::inputs::Inputs).
    pub inputs: Option<String>,
    /// Whether the program begins again when it has ended.
    pub repeat: bool,
    /// The first register of the background task; 0: there is none.
    pub telemetry: u16,
}

impl Default for ProgramSettings {
    fn default() -> Self {
        let joints = [0.0, 0.0, 0.0, 0.0, -90.0, 0.0];
        let (program, assignments, robot, inputs) = (None, None, None, None);
        Self { program, assignments, robot, joints, inputs, repeat: false, telemetry: 1 }
    }
}

impl Configure for ProgramSettings {
    fn configure(&mut self, table: &mut Table<'_>) {
        let Self { program, assignments, robot, joints, inputs, repeat, telemetry } = self;
        let about = "the program that the robot runs; those that it calls are beside it";
        table.text("program", "an LS file", "the robot goes around a circle", about, program);
        let about = "which variables the holding registers show, with a program: R[n], R[n]@1.1, PR[n], SR[n], POS[0]";
        let shape = "a file with lines such as SETVAR $SNPX_ASG[1].$ADDRESS 1, or those of SYSTEM.VA";
        table.text("assignments", shape, "the telemetry block, then R[n] in 16 bits", about, assignments);
        let about = "the robot's joints and arm, as `ls make --robot` takes them";
        table.text("robot", "a JSON file", "it is an LR Mate 200iD", about, robot);
        let default = json_text(joints);
        table.parsed("joints", "six numbers in degrees", default, "where the robot is at the start", joints);
        let shape =
            "INPUT:FROM-TO in seconds since the start, with commas between them, such as DI[1]:0-5,RI[2]:3-";
        table.text("inputs", shape, "all are off", "the inputs that are on, and when", inputs);
        table.flag("repeat", "begin the program again when it has ended", repeat);
        let about = "the first register of the background task's telemetry; 0: there is none";
        table.whole("telemetry", 0..=16_000, "", about, telemetry);
    }
}

impl Default for FanucSettings {
    fn default() -> Self {
        let stall = Framing::RTU_OVER_TCP.silence().unwrap_or_default();
        let (frames, word_order) = (Frames::Tcp, WordOrder::default());
        Self {
            frames,
            unit: None,
            broadcast: None,
            baud: 19_200,
            silence: None,
            stall,
            word_order,
            faults: None,
            program: ProgramSettings::default(),
        }
    }
}

impl FanucSettings {
    /// The server behind a TCP address.
    pub fn on_tcp(&self) -> ServerConfig {
        match self.frames {
            Frames::Tcp => self.with(ServerConfig { unit: self.unit, ..ServerConfig::tcp() }),
            Frames::Rtu => self.with(ServerConfig {
                framing: Framing::RtuOverTcp { stall: self.stall },
                ..ServerConfig::rtu_over_tcp(self.unit.unwrap_or(1))
            }),
        }
    }

    /// The server on a serial line.
    pub fn on_line(&self) -> ServerConfig {
        let mut config = ServerConfig::rtu(self.unit.unwrap_or(1), self.baud);
        if let Some(silence) = self.silence {
            config.framing = Framing::Rtu { silence };
        }
        self.with(config)
    }

    fn with(&self, config: ServerConfig) -> ServerConfig {
        ServerConfig { broadcast: self.broadcast.unwrap_or(config.broadcast), ..config }
    }
}

impl Configure for FanucSettings {
    fn configure(&mut self, table: &mut Table<'_>) {
        let Self { frames, unit, broadcast, baud, silence, stall, word_order, faults, program } = self;
        self::frames(table, frames);
        let about = "the unit that it is; auto: every one on TCP, 1 in RTU frames";
        table.whole_or("unit", 0..=u8::MAX, "auto", about, unit);
        let choices = [("auto", None), ("true", Some(true)), ("false", Some(false))];
        let about = "unit 0 is a broadcast: carried out, never answered; auto: in RTU frames";
        table.choice("broadcast", &choices, about, broadcast);
        table.baud(baud);
        let about = "the silence that ends a frame on a serial line; auto: 3.5 characters";
        table.time_or("silence", SOME_TIME, "auto", about, silence);
        table.time("stall", SOME_TIME, "without a byte for so long a frame of RTU over TCP is cut", stall);
        self::word_order(table, word_order);
        let shape = "FAULT:FROM-TO in seconds since the start, with commas between them: nan, infinite, denormal, quaternion, \
                     unreachable, standstill, restart, disconnect, busy";
        table.text("faults", shape, "there are none", "telemetry that cannot be, and when", faults);
        program.configure(table);
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

fn frames(table: &mut Table<'_>, frames: &mut Frames) {
    let about = "with MBAP headers, or as on a serial line";
    table.choice("framing", &[("tcp", Frames::Tcp), ("rtu", Frames::Rtu)], about, frames);
}

/// The order of the words of wide values.
pub fn word_order(table: &mut Table<'_>, order: &mut WordOrder) {
    let choices = [("low_first", WordOrder::LowFirst), ("high_first", WordOrder::HighFirst)];
    table.choice("word_order", &choices, "which register of a 32-bit value comes first", order);
}

/// A value that is only ever made of numbers and names.
pub fn json(value: impl serde::Serialize) -> Value {
    serde_json::to_value(value).unwrap_or_default()
}
