//! The server, with 100 of everything.

use core::time::Duration;

use anyhow::{Result, bail};
use fanuc_hmi_modbus::{
    Bits, BitsMut, Decoder, Exception, Frame, Framing, Line, Registers, Rule, Server, ServerAction,
    ServerConfig, ServerEvent, ServerInput, ServerLink, ServerMachine, ServerStatistics, Side, Words,
    WordsMut,
};
use robot_session::{Decoder as _, Session};
use serde_json::{Map, Value};

use super::{Transport, places, prefix, silent_at, timed};
use crate::ends::{Do, Driven, End, Fields, Hooks, Maker, event, show, unexpected};

pub(in crate::ends) const MAKER: Maker = Maker {
    make,
    rules: || {
        ["CheckUnit", "NoReplyToBroadcast", "ReplyAfterSilence", "DropReplies"].map(String::from).to_vec()
    },
};

const RULES: [Rule; 4] =
    [Rule::CheckUnit, Rule::NoReplyToBroadcast, Rule::ReplyAfterSilence, Rule::DropReplies];

fn make(config: &Map<String, Value>, without: Option<usize>) -> Result<Box<dyn End>> {
    let mut fields = Fields(config.clone());
    let transport = Transport::take(&mut fields)?;
    let mut made = match transport.framing()? {
        Framing::Tcp => ServerConfig::tcp(),
        Framing::Rtu { .. } => ServerConfig::rtu(1, transport.baud),
        Framing::RtuOverTcp { .. } => ServerConfig::rtu_over_tcp(1),
    };
    made.framing = transport.framing()?;
    fields.take("unit", &mut made.unit)?;
    fields.take("broadcast", &mut made.broadcast)?;
    let places = places(&mut fields)?;
    fields.end()?;
    made.without = without.and_then(|rule| RULES.get(rule)).copied();
    Ok(match places {
        2 => Box::new(Driven::<ModbusServer<2>>(Watched::new(made)?)),
        8 => Box::new(Driven::<ModbusServer<8>>(Watched::new(made)?)),
        _ => bail!("a server of the stories has 2 or 8 places"),
    })
}

struct ModbusServer<const N: usize>;

impl<const N: usize> Hooks for ModbusServer<N> {
    type Session = Watched<N>;

    fn call(_: &mut Watched<N>, _: Duration, name: &str, _: Value) -> Result<Result<(), String>> {
        bail!("a server has no call {name}")
    }

    fn event(_: &Watched<N>, happened: ServerEvent) -> Result<String> {
        Ok(match happened {
            ServerEvent::Served { transaction, unit, function, exception } => event("served")
                .optional("transaction", transaction.as_ref())?
                .raw("unit", unit)
                .raw("function", function)
                .optional("exception", exception.as_ref())?
                .end(),
            ServerEvent::Refused { transaction, unit, function } => event("refused")
                .optional("transaction", transaction.as_ref())?
                .raw("unit", unit)
                .raw("function", function)
                .end(),
            ServerEvent::Corrupt(error) => event("corrupt").raw("error", show(&error)).end(),
            ServerEvent::OutOfStep(error) => event("out_of_step").raw("error", show(&error)).end(),
            ServerEvent::Unexpected(what) => unexpected(what)?,
            _ => bail!("an event without a name"),
        })
    }

    fn state(watched: &Watched<N>) -> String {
        let machine = watched.server.machine();
        match machine.link {
            ServerLink::Up { replies: 0, .. } | ServerLink::Down => machine.name().into(),
            ServerLink::Up { replies, .. } => format!("{} ({replies})", machine.name()),
        }
    }

    fn cells(_: &Watched<N>, after: &Watched<N>, _: Duration, _: &Do, _: bool) -> Vec<String> {
        after.cells.clone()
    }

    fn transmit_cells(before: &Watched<N>, _: Duration, _: bool) -> Vec<String> {
        let mut copy = before.clone();
        copy.reaches(&["transmit"]);
        copy.cells
    }
}

/// A server, and a copy of its machine with what that is given.
#[derive(Clone)]
struct Watched<const N: usize> {
    server: Server<Tables, N>,
    machine: ServerMachine<N>,
    decoder: Decoder,
    cells: Vec<String>,
}

impl<const N: usize> Watched<N> {
    fn new(config: ServerConfig) -> Result<Self> {
        Ok(Self {
            server: Server::new(config, Tables::new())?,
            machine: ServerMachine::NEW,
            decoder: Decoder::new(config.framing, Side::Client),
            cells: Vec::new(),
        })
    }

    /// The names of the machine's state in the matrix.
    fn states(&self) -> Vec<&'static str> {
        let ServerLink::Up { line, replies } = self.machine.link else { return vec!["without a connection"] };
        let silent = line == Line::Silent;
        // Over TCP bytes do not make the line busy: two states of the matrix are one.
        let arriving = !silent || self.server.config().framing == Framing::Tcp;
        let all = [
            ("idle", replies == 0 && silent),
            ("bytes are arriving", replies == 0 && arriving),
            ("a reply waits", replies == 1 && silent),
            ("a reply waits, bytes are arriving", replies == 1 && arriving),
            ("two replies wait", replies == 2 && silent && N == 2),
        ];
        all.into_iter().filter_map(|(name, is)| is.then_some(name)).collect()
    }

    fn reaches(&mut self, inputs: &[&str]) {
        let prefix = prefix(self.server.config().framing);
        for state in self.states() {
            self.cells.extend(inputs.iter().map(|input| format!("{prefix}, {state}: {input}")));
        }
    }

    fn gives(&mut self, now: Duration, inputs: &[&str], input: ServerInput) -> ServerAction {
        self.reaches(inputs);
        self.machine.on(now, input, self.server.config()).unwrap_or(ServerAction::Ignore)
    }

    fn is_equal(&self) {
        assert!(self.machine == *self.server.machine(), "{:?}, {:?}", self.machine, self.server.machine());
    }

    fn judge(&mut self, now: Duration) {
        let mut decoder = self.decoder.clone();
        while let Some(found) = decoder.next_frame() {
            let Ok(Frame { unit, .. }) = found else { continue };
            let name = match unit {
                0 => "a request for unit 0",
                1 => "a request for this unit",
                _ => "a request for another unit",
            };
            self.gives(now, &[name], ServerInput::Request { unit });
        }
        self.decoder = decoder;
    }
}

impl<const N: usize> Session for Watched<N> {
    type Event = ServerEvent;
    type Statistics = ServerStatistics;

    const MAX_INPUT: usize = 65536;
    const MAX_TRANSMIT: usize = Frame::MAX_LEN;

    fn handle_connected(&mut self, now: Duration) {
        if self.gives(now, &["connected"], ServerInput::Connected) == ServerAction::Reset {
            self.decoder.clear();
        }
        self.server.handle_connected(now);
        self.is_equal();
    }

    fn handle_disconnected(&mut self, now: Duration) {
        if self.gives(now, &["disconnected"], ServerInput::Disconnected) == ServerAction::Reset {
            self.decoder.clear();
        }
        self.server.handle_disconnected(now);
        self.is_equal();
    }

    fn handle_input(&mut self, now: Duration, bytes: &[u8]) {
        if let (ServerLink::Up { line, .. }, false) = (self.machine.link, bytes.is_empty()) {
            let names = timed(silent_at(line), now, "bytes", "bytes after a silence");
            let action = self.gives(now, &names, ServerInput::Received);
            if matches!(action, ServerAction::Judge { cut: true } | ServerAction::Keep { cut: true }) {
                self.decoder.finish();
                self.judge(now);
            }
            let mut rest = bytes;
            while !rest.is_empty() {
                let taken = self.decoder.push(rest);
                rest = rest.get(taken..).unwrap_or_default();
                if matches!(action, ServerAction::Judge { .. }) {
                    self.judge(now);
                } else if taken == 0 {
                    self.decoder.clear();
                }
            }
        }
        self.server.handle_input(now, bytes);
        self.is_equal();
    }

    fn handle_timeout(&mut self, now: Duration) {
        loop {
            let names = timed(self.machine.deadline(), now, "timer, early", "timer");
            if self.gives(now, &names, ServerInput::Timer) != ServerAction::Cut {
                break;
            }
            self.decoder.finish();
            self.judge(now);
        }
        self.server.handle_timeout(now);
        self.is_equal();
    }

    fn poll_event(&mut self) -> Option<ServerEvent> {
        self.server.poll_event()
    }

    fn poll_transmit(&mut self, now: Duration, out: &mut [u8]) -> Option<usize> {
        // Its cell is known before: `transmit_cells`.
        let _ = self.machine.on(now, ServerInput::Transmit, self.server.config());
        let length = self.server.poll_transmit(now, out);
        self.is_equal();
        length
    }

    fn poll_timeout(&self) -> Option<Duration> {
        self.server.poll_timeout()
    }

    fn statistics(&self) -> ServerStatistics {
        self.server.statistics()
    }
}

/// What reference/README.md says that a server of the stories holds.
#[derive(Clone)]
struct Tables {
    coils: [bool; 100],
    holding: [u16; 100],
}

impl Tables {
    fn new() -> Self {
        Self {
            coils: core::array::from_fn(|address| address % 3 == 0),
            holding: core::array::from_fn(|address| u16::try_from(7 * address).unwrap_or_default()),
        }
    }
}

/// The items of a request, if the table has all of them.
fn items<T>(table: &mut [T], address: u16, count: usize) -> Result<&mut [T], Exception> {
    let first = usize::from(address);
    table.get_mut(first..first + count).ok_or(Exception::IllegalDataAddress)
}

impl Registers for Tables {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        let bits = items(&mut self.coils, address, out.len())?;
        bits.iter().enumerate().for_each(|(index, bit)| out.set(index, *bit));
        Ok(())
    }

    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        let bits = items(&mut self.coils, address, out.len())?;
        bits.iter().enumerate().for_each(|(index, bit)| out.set(index, !*bit));
        Ok(())
    }

    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.copy_from(items(&mut self.holding, address, out.len())?);
        Ok(())
    }

    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        values.copy_to(items(&mut self.coils, address, values.len())?);
        Ok(())
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        values.copy_to(items(&mut self.holding, address, values.len())?);
        Ok(())
    }

    fn other(&mut self, function: u8, data: &[u8], out: &mut [u8]) -> Result<usize, Exception> {
        match function {
            65 => {
                out.iter_mut().zip(data).for_each(|(to, from)| *to = *from);
                Ok(data.len())
            }
            66 => Ok(out.len() + 1),
            67 => Err(Exception::ServerDeviceBusy),
            _ => Err(Exception::IllegalFunction),
        }
    }
}
