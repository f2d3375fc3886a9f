//! The settings of the link: its frames, the server and the client.

use std::time::Duration;

use anyhow::{Result, bail};
use fanuc_hmi_modbus::{Framing, ServerConfig, WordOrder};

use super::program::Macros;
use cellwire_links::fanuc_hmi_modbus::{Frames, frames as frames_setting, word_order as word_order_setting};
use cellwire_links::settings::{Configure, FieldVisitor, SOME_TIME};

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
    /// The time for which the rest of a request is awaited on a serial line; `None`: 20 ms and 32 characters.
    pub frame_timeout: Option<Duration>,
    /// Whether the line returns the sent bytes.
    pub echo: bool,
    /// The order of the words of wide values.
    pub word_order: WordOrder,
    /// The faults of the telemetry, with their times: see [`TelemetryFaults`](cellwire_sim::fanuc::TelemetryFaults). `None`
    /// without faults.
    pub faults: Option<String>,
    /// The objects of its device identification: see [`Identification`](cellwire_sim::fanuc::Identification). `None`: it has no
    /// identification.
    pub identification: Option<String>,
    /// The eight outputs that function 7 reads; `None`: it refuses that.
    pub exception_status: Option<u8>,
    /// The files of functions 20 and 21: see [`Lists`](cellwire_sim::fanuc::Lists). `None`: it refuses these.
    pub files: Option<String>,
    /// The queues of function 24: see [`Lists`](cellwire_sim::fanuc::Lists). `None`: it refuses that.
    pub queues: Option<String>,
    /// The accesses that the roles of clients permit: see [`Roles`](cellwire_sim::fanuc::Roles). `None`: every client may do
    /// everything.
    pub roles: Option<String>,
    /// The program that the robot runs.
    pub program: ProgramSettings,
}

/// The program of the robot, and its settings.
#[derive(Debug, Clone)]
pub struct ProgramSettings {
    /// The LS file; programs that it calls are in the same folder. `None`: the robot goes around a circle.
    pub program: Option<String>,
    /// The file with a listing of `$SNPX_ASG`; `None`: the telemetry block, then R\[n\] in 16 bits.
    pub assignments: Option<String>,
    /// The file with the robot's description, as `ls make` takes it; `None`: an LR Mate 200iD.
    pub robot: Option<String>,
    /// J1 to J6 at the start, in degrees.
    pub joints: [f64; 6],
    /// The signals that come from outside, as [`Inputs`](super::inputs::Inputs) reads them; `None`: all are off.
    pub inputs: Option<String>,
    /// Whether the program begins again when it has ended.
    pub repeat: bool,
    /// The first register of the background task; 0: no such task.
    pub telemetry: u16,
    /// Whether that task does not run if it would write registers that the program uses.
    pub leaves_registers: bool,
    /// The programs of macros, by the names of these in capitals.
    pub macros: Macros,
    /// Whether the tool goes anywhere, whatever the arm reaches.
    pub anywhere: bool,
}

impl Default for ProgramSettings {
    fn default() -> Self {
        let joints = [0.0, 0.0, 0.0, 0.0, -90.0, 0.0];
        let (program, assignments, robot, inputs) = (None, None, None, None);
        let (repeat, telemetry, leaves_registers) = (false, 1, false);
        let (macros, anywhere) = (Macros::new(), false);
        Self {
            program,
            assignments,
            robot,
            joints,
            inputs,
            repeat,
            telemetry,
            leaves_registers,
            macros,
            anywhere,
        }
    }
}

impl Configure for ProgramSettings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        // Two of the others are of `ls run` alone, and one follows from the given ones.
        let Self { program, assignments, robot, joints, inputs, repeat, telemetry, .. } = self;
        let about = "the program that the robot runs; programs that it calls are in the same folder";
        fields.text("program", "an LS file", "the robot goes around a circle", about, program);
        let about =
            "the variables of the holding registers, with a program: R[n], R[n]@1.1, PR[n], SR[n], POS[0]";
        let shape = "a file with lines such as SETVAR $SNPX_ASG[1].$ADDRESS 1, or those of SYSTEM.VA";
        fields.text("assignments", shape, "the telemetry block, then R[n] in 16 bits", about, assignments);
        let about = "the robot's joints and arm, as for `ls make --limits`";
        fields.text("robot", "a JSON file", "an LR Mate 200iD", about, robot);
        fields.parsed("joints", "six numbers in degrees", "the robot's start position", joints);
        let shape =
            "INPUT:FROM-TO in seconds since the start, with commas between them, such as DI[1]:0-5,RI[2]:3-";
        fields.text("inputs", shape, "all are off", "inputs that are on, with times", inputs);
        fields.flag("repeat", "begin the program again when it has ended", repeat);
        let about = "the first register of the background task's telemetry; 0: none, which is the default if the program uses R[1] to R[19]";
        fields.whole("telemetry", 0..=16_000, "", about, telemetry);
    }
}

impl ProgramSettings {
    /// Checks that no settings are given that have no effect without a program.
    ///
    /// # Errors
    /// If one of them is given without a program.
    pub fn check(&self) -> Result<()> {
        let given = [
            ("assignments", self.assignments.is_some()),
            ("robot", self.robot.is_some()),
            ("inputs", self.inputs.is_some()),
            ("repeat", self.repeat),
        ];
        match given.into_iter().find(|(_, is_given)| *is_given && self.program.is_none()) {
            Some((name, _)) => bail!("{name} has no effect without a program: give --set program=FILE.LS"),
            None => Ok(()),
        }
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
            frame_timeout: None,
            echo: false,
            word_order,
            faults: None,
            identification: None,
            exception_status: None,
            files: None,
            queues: None,
            roles: None,
            program: ProgramSettings::default(),
        }
    }
}

impl FanucSettings {
    /// Returns the configuration of a server on a TCP address.
    pub fn on_tcp(&self) -> ServerConfig {
        match self.frames {
            Frames::Tcp => self.with(ServerConfig { unit: self.unit, ..ServerConfig::tcp() }),
            Frames::Rtu => self.with(ServerConfig {
                framing: Framing::RtuOverTcp { stall: self.stall },
                ..ServerConfig::rtu_over_tcp(self.unit.unwrap_or(1))
            }),
        }
    }

    /// Returns the server on a serial line.
    pub fn on_line(&self) -> ServerConfig {
        let mut config = ServerConfig::rtu(self.unit.unwrap_or(1), self.baud);
        if let Some(silence) = self.silence {
            config.framing = Framing::Rtu { silence };
        }
        self.with(config)
    }

    /// Returns the settings that have no effect on a serial line, or on TCP.
    pub fn unused(&self, is_line: bool) -> Vec<&'static str> {
        let mut unused = Vec::new();
        if is_line {
            unused.push("stall");
            if self.frames == Frames::Tcp {
                unused.push("framing"); // the frames of a line are RTU
            }
        } else {
            unused.extend(["baud", "silence"]);
            if self.frames == Frames::Tcp {
                unused.extend(["stall", "frame_timeout"]);
            }
        }
        if self.program.program.is_none() {
            unused.extend(["joints", "telemetry"]);
        }
        unused
    }

    fn with(&self, config: ServerConfig) -> ServerConfig {
        let broadcast = self.broadcast.unwrap_or(config.broadcast);
        let frame_timeout = self.frame_timeout.unwrap_or(config.frame_timeout);
        ServerConfig { broadcast, frame_timeout, echo: self.echo, ..config }
    }
}

impl Configure for FanucSettings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self {
            frames,
            unit,
            broadcast,
            baud,
            silence,
            stall,
            frame_timeout,
            echo,
            word_order,
            faults,
            identification,
            exception_status,
            files,
            queues,
            roles,
            program,
        } = self;
        frames_setting(fields, frames);
        let about = "its unit number; auto: all on TCP, 1 in RTU frames";
        fields.whole_or("unit", 0..=u8::MAX, "", "auto", about, unit);
        let choices = [("auto", None), ("true", Some(true)), ("false", Some(false))];
        let about = "unit 0 is a broadcast, executed without a reply; auto: in RTU frames";
        fields.choice("broadcast", &choices, about, broadcast);
        fields.baud("the rate of the serial line, 11 bits a byte", baud);
        let about = "the silence that ends a frame on a serial line; auto: 3.5 characters";
        fields.time_or("silence", SOME_TIME, "auto", about, silence);
        fields.time("stall", SOME_TIME, "in RTU over TCP, the silence that ends a frame", stall);
        let about =
            "on a serial line, how long the rest of a request is waited for; auto: 20 ms and 32 characters";
        fields.time_or("frame_timeout", SOME_TIME, "auto", about, frame_timeout);
        fields.echo(echo);
        word_order_setting(fields, word_order);
        let shape = "FAULT:FROM-TO in seconds since the start, with commas between them: nan, infinite, denormal, quaternion, \
                     unreachable, standstill, restart, disconnect, busy";
        fields.text("faults", shape, "there are none", "implausible telemetry, with times", faults);
        let shape = "ID:TEXT with commas between them, such as 0:FANUC,1:R-30iB,2:V9.40";
        let about = "the objects of its device identification, function 43";
        fields.text("identification", shape, "it has none", about, identification);
        let about = "the eight outputs that function 7 reads; none: it refuses function 7";
        fields.whole_or("exception_status", 0..=u8::MAX, "", "none", about, exception_status);
        let shape = "NUMBER:VALUE VALUE… with commas between them, such as 4:10 20 30,5:1";
        fields.text("files", shape, "it has none", "the registers of its files, functions 20 and 21", files);
        let about = "the registers of its queues by the address of their count, function 24";
        fields.text("queues", shape, "it has none", about, queues);
        let shape = "ROLE:FUNCTION or ROLE:FUNCTION@FIRST-LAST with commas between them, such as operator:read,engineer:write@100-199; \
                     FUNCTION is any, read, write or a number";
        let about = "the accesses that the role in a client's certificate permits (--tls); others are refused with exception 1";
        fields.text("roles", shape, "every client may do everything", about, roles);
        program.configure(fields);
    }
}
