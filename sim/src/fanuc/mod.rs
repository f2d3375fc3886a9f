//! A FANUC controller over Modbus: the tables of the source's Table 1, and the background task of its Fig. 8.

mod background;
mod controller;
mod faults;
mod identification;
mod lists;
mod roles;
mod tables;

use core::time::Duration;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fanuc_hmi_modbus::security::{Access, RoleError, role};
use fanuc_hmi_modbus::{
    Bits, BitsMut, Exception, Registers, Server, ServerConfig, ServerEvent, Table, WordOrder, Words, WordsMut,
};
use robot_session::end::End as _;

pub use self::background::{PERIOD, Pose, background_task};
pub use self::controller::{Controller, Motion, Program, circle};
pub use self::faults::{NoFault, TelemetryFault, TelemetryFaults};
pub use self::identification::{Identification, NoObject};
pub use self::lists::{Lists, NoList};
pub use self::roles::{NoPermission, Roles};
pub use self::tables::Tables;
use crate::device::{Device, DeviceRecord, Error};
use crate::settings::Settings;

/// A FANUC controller's settings. Its robot goes around a circle; one with another robot is made by [`FanucController::new`].
#[derive(Debug, Clone, Default)]
pub struct Fanuc {
    /// The configuration of its end of each connection.
    pub config: ServerConfig,
    /// The order of the words of wide values.
    pub word_order: WordOrder,
    /// The faults of the telemetry, with their times.
    pub faults: TelemetryFaults,
    /// The objects of its device identification; without object 0 it has no identification.
    pub identification: Identification,
    /// The eight outputs that function 7 reads; `None`: it refuses that.
    pub exception_status: Option<u8>,
    /// The files of functions 20 and 21, by number; none: it refuses these.
    pub files: Lists,
    /// The queues of function 24, by the address of their count; none: it refuses that.
    pub queues: Lists,
    /// The accesses that the role in a client's certificate permits; others are refused with exception 1. Without it every
    /// client may do everything.
    pub roles: Roles,
}

impl Settings for Fanuc {
    type Device = FanucController;

    fn device(&self) -> Result<FanucController, Error> {
        let controller = Controller::new(Box::new(circle), self.word_order)
            .with_faults(self.faults.clone())
            .with_identification(self.identification.clone())
            .with_exception_status(self.exception_status)
            .with_files(self.files.clone(), self.queues.clone())
            .with_roles(self.roles.clone());
        FanucController::new(self.config, Arc::new(Mutex::new(controller)))
    }
}

/// A controller that connections share: every connection sees the same registers.
pub type Shared = Arc<Mutex<Controller>>;

/// A client's write.
#[derive(Debug, Clone, PartialEq, Eq, Hash)]
pub enum Write {
    /// Outputs, from this address on.
    Coils(u16, Vec<bool>),
    /// Holding registers, from this address on.
    Registers(u16, Vec<u16>),
}

/// An event of a FANUC controller.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum FanucEvent {
    /// An event of the server: a request, corrupt bytes.
    Server(ServerEvent),
    /// A client has shown its certificate, which has this role; `None`: no role.
    Role(Result<Option<String>, RoleError>),
    /// A client has read values.
    Read {
        /// The table that the values are in.
        table: Table,
        /// The PDU address of the first value, from 0.
        address: u16,
        /// The number of values, from 1.
        count: u16,
    },
    /// A client has written values.
    Written(Write),
    /// A request was answered with an exception.
    Refused {
        /// The unit of the request.
        unit: u8,
        /// The function code of the request.
        function: u8,
        /// The reason of the refusal.
        exception: Exception,
        /// The table, the PDU address of the first value, and the number of values; `None` if the request was not looked up
        /// in a table: an unknown function, or a quantity of 0.
        values: Option<(Table, u16, u16)>,
    },
}

/// A FANUC controller on one connection; [another](Device::another) has the same registers.
#[allow(missing_debug_implementations, reason = "a motion is a function")]
pub struct FanucController {
    server: Server<Connection>,
}

impl FanucController {
    /// Creates one connection to a controller.
    ///
    /// # Errors
    /// A configuration that cannot work.
    pub fn new(config: ServerConfig, controller: Shared) -> Result<Self, Error> {
        let connection = Connection { controller, role: None, accesses: Vec::new(), refusals: Vec::new() };
        Ok(Self { server: Server::new(config, connection).map_err(Error::settings)? })
    }

    /// Returns the controller that all its connections share.
    pub fn controller(&self) -> MutexGuard<'_, Controller> {
        self.server.registers().lock()
    }
}

impl Device for FanucController {
    type Session = Server<Connection>;
    type Event = FanucEvent;
    type Work = Write;

    fn session(&self) -> &Self::Session {
        &self.server
    }

    fn session_mut(&mut self) -> &mut Self::Session {
        &mut self.server
    }

    fn take(&mut self, _: Duration, event: ServerEvent, notes: &mut DeviceRecord<FanucEvent, Write>) {
        if matches!(event, ServerEvent::OutOfStep(_)) {
            notes.close("the client is out of step");
        }
        notes.event(FanucEvent::Server(event));
        if let ServerEvent::Served { unit, function, exception: Some(exception), .. } = event {
            let values = self.server.registers_mut().refused(function, exception);
            notes.event(FanucEvent::Refused { unit, function, exception, values });
        }
    }

    fn advance(&mut self, now: Duration, notes: &mut DeviceRecord<FanucEvent, Write>) {
        for access in self.server.registers_mut().accesses.drain(..) {
            if let FanucEvent::Written(write) = &access {
                notes.executed(now, write.clone());
            }
            notes.event(access);
        }
        let mut controller = self.controller();
        controller.tick(now);
        if controller.is_away(now) {
            notes.close("the fault `disconnect`");
        }
    }

    fn due(&self) -> Option<Duration> {
        None
    }

    /// Restarts the connection. A battery keeps the registers.
    fn restart(&mut self, _: Duration) {
        let (config, shared) = (*self.server.config(), Arc::clone(&self.server.registers().controller));
        // The same configuration has worked before.
        if let Ok(device) = Self::new(config, shared) {
            *self = device;
        }
    }

    /// Discards the clients' writes.
    fn forget(&mut self, now: Duration) {
        let mut controller = self.controller();
        controller.forget();
        controller.tick(now);
    }

    fn secured(&mut self, certificate: &[u8]) {
        let connection = self.server.registers_mut();
        let role = role(certificate).map(|role| role.map(String::from));
        connection.role = role.clone().ok().flatten();
        connection.accesses.push(FanucEvent::Role(role));
    }

    fn another(&self) -> Option<Self> {
        let shared = Arc::clone(&self.server.registers().controller);
        Self::new(*self.server.config(), shared).ok()
    }
}

/// The controller as one connection reaches it.
#[allow(missing_debug_implementations, reason = "a motion is a function")]
pub struct Connection {
    controller: Shared,
    /// The role in the client's certificate.
    role: Option<String>,
    /// Reads and writes that the device has not reported yet.
    accesses: Vec<FanucEvent>,
    /// Refused accesses whose requests the device has not reported yet.
    refusals: Vec<Refusal>,
}

/// An access that a table has refused.
#[derive(Debug, Clone, Copy)]
struct Refusal {
    values: (Table, u16, u16),
    is_write: bool,
    exception: Exception,
}

impl Refusal {
    /// Returns whether a request of this function makes such an access.
    fn is_of(&self, function: u8) -> bool {
        let functions: &[u8] = match (self.values.0, self.is_write) {
            (Table::Coils, false) => &[1],
            (Table::Coils, true) => &[5, 15],
            (Table::DiscreteInputs, _) => &[2],
            (Table::InputRegisters, _) => &[4],
            (Table::HoldingRegisters, false) => &[3, 22, 23],
            (Table::HoldingRegisters, true) => &[6, 16, 22, 23],
        };
        functions.contains(&function)
    }
}

/// The most refusals that are kept: requests in one turn.
const MAX_REFUSALS: usize = 64;

impl Connection {
    /// Removes and returns the values of a refused request; older refusals are dropped.
    fn refused(&mut self, function: u8, exception: Exception) -> Option<(Table, u16, u16)> {
        let is_it = |refusal: &Refusal| refusal.exception == exception && refusal.is_of(function);
        let at = self.refusals.iter().position(is_it)?;
        self.refusals.drain(..=at).next_back().map(|refusal| refusal.values)
    }

    fn lock(&self) -> MutexGuard<'_, Controller> {
        self.controller.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Returns the controller, if the client's role permits the access.
    fn permitted(
        &self,
        function: u8,
        address: u16,
        count: usize,
    ) -> Result<MutexGuard<'_, Controller>, Exception> {
        let quantity = u16::try_from(count).unwrap_or(u16::MAX);
        let controller = self.lock();
        match controller.roles().allows(self.role.as_deref(), Access { function, address, quantity }) {
            true => Ok(controller),
            false => Err(Exception::IllegalFunction),
        }
    }

    /// Notes a read, and whether the table refuses it.
    #[expect(clippy::cast_possible_truncation, reason = "a request reads 2000 values at most")]
    fn read(
        &mut self,
        (table, address, count): (Table, u16, usize),
        outcome: Result<(), Exception>,
    ) -> Result<(), Exception> {
        let count = count as u16;
        match outcome {
            Ok(()) => self.accesses.push(FanucEvent::Read { table, address, count }),
            Err(exception) => self.refuse((table, address, count), false, exception),
        }
        outcome
    }

    /// Notes a write, and whether the table refuses it.
    #[expect(clippy::cast_possible_truncation, reason = "a request writes 1968 values at most")]
    fn write(
        &mut self,
        (table, address, count): (Table, u16, usize),
        outcome: Result<(), Exception>,
        write: impl FnOnce() -> Write,
    ) -> Result<(), Exception> {
        match outcome {
            Ok(()) => self.accesses.push(FanucEvent::Written(write())),
            Err(exception) => self.refuse((table, address, count as u16), true, exception),
        }
        outcome
    }

    fn refuse(&mut self, values: (Table, u16, u16), is_write: bool, exception: Exception) {
        if self.refusals.len() == MAX_REFUSALS {
            self.refusals.remove(0);
        }
        self.refusals.push(Refusal { values, is_write, exception });
    }
}

impl Registers for Connection {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        let read = self.permitted(1, address, out.len()).and_then(|mut it| it.read_coils(address, out));
        self.read((Table::Coils, address, out.len()), read)
    }

    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        let read =
            self.permitted(2, address, out.len()).and_then(|mut it| it.read_discrete_inputs(address, out));
        self.read((Table::DiscreteInputs, address, out.len()), read)
    }

    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let read =
            self.permitted(3, address, out.len()).and_then(|mut it| it.read_holding_registers(address, out));
        self.read((Table::HoldingRegisters, address, out.len()), read)
    }

    fn read_input_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        let read =
            self.permitted(4, address, out.len()).and_then(|mut it| it.read_input_registers(address, out));
        self.read((Table::InputRegisters, address, out.len()), read)
    }

    fn exception_status(&mut self) -> Result<u8, Exception> {
        self.permitted(7, 0, 0)?.exception_status()
    }

    fn read_file(&mut self, file: u16, record: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.permitted(20, file, out.len())?.read_file(file, record, out)
    }

    fn write_file(&mut self, file: u16, record: u16, values: Words<'_>) -> Result<(), Exception> {
        self.permitted(21, file, values.len())?.write_file(file, record, values)
    }

    fn read_fifo(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<usize, Exception> {
        self.permitted(24, address, 0)?.read_fifo(address, out)
    }

    fn device_object(&mut self, id: u8, out: &mut [u8]) -> Option<usize> {
        self.permitted(43, id.into(), 1).ok()?.device_object(id, out)
    }

    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        let written =
            self.permitted(15, address, values.len()).and_then(|mut it| it.write_coils(address, values));
        let write = || Write::Coils(address, values.iter().collect());
        self.write((Table::Coils, address, values.len()), written, write)
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        let written =
            self.permitted(16, address, values.len()).and_then(|mut it| it.write_registers(address, values));
        let write = || Write::Registers(address, values.iter().collect());
        self.write((Table::HoldingRegisters, address, values.len()), written, write)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A request to all units is refused without an event.
    #[test]
    fn a_refusal_is_that_of_a_request_with_its_function_and_its_exception() {
        let controller = Controller::new(Box::new(circle), WordOrder::LowFirst);
        let mut device = FanucController::new(ServerConfig::tcp(), Arc::new(controller.into())).unwrap();
        let connection = device.server.registers_mut();
        let busy = Exception::ServerDeviceBusy;
        for (address, is_write, exception) in
            [(1, true, busy), (2, false, Exception::IllegalDataAddress), (3, false, busy)]
        {
            connection.refuse((Table::Coils, address, 1), is_write, exception);
        }
        assert_eq!(connection.refused(1, busy), Some((Table::Coils, 3, 1)));
        assert_eq!(connection.refused(5, busy), None, "older ones are dropped");
    }
}
