//! The simulated FANUC controller: the tables of the source's Table 1, and the background task of its Fig. 8.

use core::ops::Range;
use core::time::Duration;

use fanuc_hmi_modbus::{
    Bits, BitsMut, Exception, Registers, Signal, Table, TelemetryBlock, WordOrder, Words, WordsMut,
};

use super::background::{PERIOD, Pose, background_task};
use super::faults::{TelemetryFault as Fault, TelemetryFaults as Faults};
use super::identification::Identification;
use super::lists::Lists;
use super::roles::Roles;
use super::tables::Tables;

/// The pose of the tool at a time since the start of the program.
pub type Motion = Box<dyn Fn(Duration) -> Pose + Send>;

/// Returns a point of a circle of 200 mm at 100 mm/s, the tool pointing down and swaying.
pub fn circle(at: Duration) -> Pose {
    let t = at.as_secs_f64();
    Pose {
        position: [500.0 + 100.0 * t.cos(), 100.0 * t.sin(), 300.0 + 20.0 * (0.5 * t).sin()],
        wpr: [180.0 - 10.0 * (0.7 * t).sin(), 5.0 * t.sin(), 45.0 + 20.0 * (0.3 * t).cos()],
    }
}

/// The registers of a controller over Modbus: the [`Tables`], and in the holding registers the telemetry of the
/// robot.
#[allow(missing_debug_implementations, reason = "a motion is a function")]
pub struct Controller {
    source: RegisterSource,
    faults: Faults,
    identification: Identification,
    exception_status: Option<u8>,
    files: Lists,
    queues: Lists,
    roles: Roles,
    now: Duration,
    /// The run that the background task has done last.
    run: Option<u32>,
    tables: Tables,
    order: WordOrder,
}

/// The source of the registers.
enum RegisterSource {
    Motion(Motion),
    Program(Box<dyn Program>),
}

/// A robot that runs a program, and keeps the controller's tables.
pub trait Program: Send {
    /// Goes on for one period of the background task, which ends at `at`, its run of this number.
    fn run(&mut self, at: Duration, number: u32, faults: &Faults, tables: &mut Tables);

    /// Called when a client has written to these holding registers, from PDU address 0 on.
    fn written(&mut self, registers: Range<usize>, tables: &Tables);

    /// Writes its values to the holding registers.
    fn show(&mut self, tables: &mut Tables);

    /// Returns the PDU address of the holding register that shows R\[n\] as a whole number of 16 bits; `None` if there is no
    /// such register. Without assignments of its own, it is n - 1.
    fn register(&self, number: u16) -> Option<u16> {
        number.checked_sub(1)
    }
}

impl Controller {
    /// Creates a controller that has just been switched on, whose robot moves by itself.
    pub fn new(motion: Motion, order: WordOrder) -> Self {
        Self::with(RegisterSource::Motion(motion), Tables::numbered(), order)
    }

    /// Creates a controller whose robot runs a program.
    pub fn running(program: Box<dyn Program>, order: WordOrder) -> Self {
        Self::with(RegisterSource::Program(program), Tables::empty(), order)
    }

    fn with(source: RegisterSource, tables: Tables, order: WordOrder) -> Self {
        Self {
            source,
            faults: Faults::default(),
            identification: Identification::default(),
            exception_status: None,
            files: Lists::default(),
            queues: Lists::default(),
            roles: Roles::default(),
            now: Duration::ZERO,
            run: None,
            tables,
            order,
        }
    }

    /// Returns the controller with faults.
    #[must_use]
    pub fn with_faults(mut self, faults: Faults) -> Self {
        self.faults = faults;
        self
    }

    /// Sets the device identification.
    #[must_use]
    pub fn with_identification(mut self, identification: Identification) -> Self {
        self.identification = identification;
        self
    }

    /// Returns the controller with eight outputs for function 7.
    #[must_use]
    pub const fn with_exception_status(mut self, status: Option<u8>) -> Self {
        self.exception_status = status;
        self
    }

    /// Returns the controller with files and queues.
    #[must_use]
    pub fn with_files(mut self, files: Lists, queues: Lists) -> Self {
        (self.files, self.queues) = (files, queues);
        self
    }

    /// Returns the controller with roles of its clients.
    #[must_use]
    pub fn with_roles(mut self, roles: Roles) -> Self {
        self.roles = roles;
        self
    }

    /// Returns the roles of the controller's clients.
    pub const fn roles(&self) -> &Roles {
        &self.roles
    }

    /// Returns whether clients cannot reach the controller now.
    pub fn is_away(&self, now: Duration) -> bool {
        self.faults.has(Fault::Disconnect, now)
    }

    /// Returns the registers and signals, to read them and to set inputs.
    pub fn tables_mut(&mut self) -> &mut Tables {
        &mut self.tables
    }

    /// Returns the PDU address of the holding register that shows R\[n\] as a whole number of 16 bits.
    pub fn register(&self, number: u16) -> Option<u16> {
        match &self.source {
            RegisterSource::Program(program) => program.register(number),
            RegisterSource::Motion(_) => number.checked_sub(1),
        }
    }

    /// Returns the values from this PDU address of a table on, 0 or 1 for a bit; `None` outside the table.
    pub fn values(&self, table: Table, address: u16, count: u16) -> Option<Vec<u16>> {
        let place = |offset| Signal::at(table, address.checked_add(offset)?);
        (0..count).map(|offset| self.tables.signal(place(offset)?)).collect()
    }

    /// Sets values from this PDU address of a table on, 0 or 1 of a bit, as the cell, an operator or the controller itself
    /// does, and a program reads them. `None` outside the table: then nothing is set.
    pub fn set_values(&mut self, table: Table, address: u16, values: &[u16]) -> Option<()> {
        let end = usize::from(address) + values.len();
        self.values(table, address, u16::try_from(values.len()).ok()?)?;
        for (address, value) in (address..).zip(values) {
            self.tables.set_signal(Signal::at(table, address)?, *value)?;
        }
        if let (RegisterSource::Program(program), Table::HoldingRegisters) = (&mut self.source, table) {
            program.written(address.into()..end, &self.tables);
        }
        Some(())
    }

    /// Discards the values that clients have written. The next [`tick`](Self::tick) writes those of the robot.
    pub(super) fn forget(&mut self) {
        match &mut self.source {
            RegisterSource::Motion(_) => (self.run, self.tables) = (None, Tables::numbered()),
            RegisterSource::Program(program) => {
                self.tables = Tables::empty();
                program.show(&mut self.tables);
            }
        }
    }

    /// Runs the background task as often as it is due. It overwrites a client's writes to its registers.
    pub fn tick(&mut self, now: Duration) {
        self.now = now;
        let (run, last) = (runs(now), self.run);
        if last.is_some_and(|last| last >= run) {
            return;
        }
        self.run = Some(run);
        match &mut self.source {
            RegisterSource::Motion(_) if self.faults.has(Fault::Standstill, now) && last.is_some() => {}
            RegisterSource::Motion(motion) => {
                let registers = block(motion, &self.faults, run).to_registers(self.order);
                if let Some(area) = self.tables.holding_registers.first_chunk_mut() {
                    *area = registers;
                }
            }
            RegisterSource::Program(program) => {
                for run in last.map_or(0, |last| last + 1)..=run {
                    let at = PERIOD * run;
                    program.run(at, runs(self.faults.task_time(at)), &self.faults, &mut self.tables);
                }
                program.show(&mut self.tables);
            }
        }
    }

    /// Checks that the controller is not busy; otherwise returns its exception.
    fn ready(&self) -> Result<(), Exception> {
        if self.faults.has(Fault::Busy, self.now) { Err(Exception::ServerDeviceBusy) } else { Ok(()) }
    }
}

/// Returns the telemetry that the background task writes at the period `run` since the start.
fn block(motion: &Motion, faults: &Faults, run: u32) -> TelemetryBlock {
    let at = PERIOD * run;
    let pose = |run: u32| motion(PERIOD * run);
    let counter = runs(faults.task_time(at));
    let mut block = background_task(counter, &pose(run), &pose(run.saturating_sub(1)));
    faults.spoil(&mut block, at);
    block
}

/// Returns the number of periods in this time.
fn runs(time: Duration) -> u32 {
    u32::try_from(time.as_millis() / PERIOD.as_millis()).unwrap_or(u32::MAX)
}

impl Registers for Controller {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        self.ready()?;
        self.tables.read_coils(address, out)
    }

    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        self.ready()?;
        self.tables.read_discrete_inputs(address, out)
    }

    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.ready()?;
        self.tables.read_holding_registers(address, out)
    }

    fn read_input_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.ready()?;
        self.tables.read_input_registers(address, out)
    }

    fn exception_status(&mut self) -> Result<u8, Exception> {
        self.ready()?;
        self.exception_status.ok_or(Exception::IllegalFunction)
    }

    fn read_file(&mut self, file: u16, record: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.ready()?;
        self.files.read(file, record, out)
    }

    fn write_file(&mut self, file: u16, record: u16, values: Words<'_>) -> Result<(), Exception> {
        self.ready()?;
        self.files.write(file, record, values)
    }

    fn read_fifo(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<usize, Exception> {
        self.ready()?;
        let queue = self.queues.get(address)?;
        out.copy_from(queue);
        Ok(queue.len())
    }

    fn device_object(&mut self, id: u8, out: &mut [u8]) -> Option<usize> {
        self.identification.write(id, out)
    }

    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        self.ready()?;
        self.tables.write_coils(address, values)
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        self.ready()?;
        let written = usize::from(address)..usize::from(address) + values.len();
        self.tables.write_registers(address, values)?;
        if let RegisterSource::Program(program) = &mut self.source {
            program.written(written, &self.tables);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_set_whole_or_not_at_all() {
        let mut controller = Controller::new(Box::new(circle), WordOrder::LowFirst);
        // DI[9999] to RI[2].
        assert_eq!(controller.values(Table::DiscreteInputs, 9_998, 4), Some(vec![1, 0, 0, 1]));
        assert_eq!(controller.set_values(Table::DiscreteInputs, 9_999, &[1, 7]), Some(()));
        assert_eq!(controller.values(Table::DiscreteInputs, 9_998, 4), Some(vec![1, 1, 1, 1]));
        assert_eq!(controller.set_values(Table::HoldingRegisters, 16_447, &[5, 6]), None);
        assert_eq!(controller.values(Table::HoldingRegisters, 16_447, 1), Some(vec![0]));
        assert_eq!(controller.values(Table::HoldingRegisters, u16::MAX, 2), None);
    }

    #[test]
    fn the_task_overwrites_its_registers_at_its_next_run_and_no_others() {
        let mut controller = Controller::new(Box::new(circle), WordOrder::LowFirst);
        controller.tick(Duration::from_millis(80));
        controller.write_registers(35, Words::from(&[1, 2, 3, 4])).unwrap();
        controller.tick(Duration::from_millis(87));
        assert_eq!(controller.tables.holding_registers[35..39], [1, 2, 3, 4]);
        controller.tick(Duration::from_millis(88));
        assert_ne!(controller.tables.holding_registers[35..37], [1, 2]);
        assert_eq!(controller.tables.holding_registers[37..39], [3, 4]);
        assert_eq!(controller.tables.holding_registers[..3], [11, 0, 100]);
        assert_eq!(controller.tables.holding_registers[39..41], [40, 41]);
    }
}
