//! The simulated FANUC controller: the tables of the source's Table 1, and the background task of its Fig. 8.

use std::time::Duration;

use fanuc_hmi_modbus::{
    Bits, BitsMut, Exception, Registers, Signal, Table, TelemetryBlock, WordOrder, Words, WordsMut,
};

use super::faults::{Fault, Faults};

/// The period of the background task (Fig. 8).
pub const PERIOD: Duration = Duration::from_millis(8);

/// Where the tool is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// X, Y, Z in mm.
    pub position: [f64; 3],
    /// W, P, R in degrees about the fixed axes X, Y, Z.
    pub wpr: [f64; 3],
}

/// Where the tool is at a time since the start of the program.
pub type Motion = Box<dyn Fn(Duration) -> Pose + Send>;

/// A circle of 200 mm at 100 mm/s, the tool pointing down and swaying.
pub fn circle(at: Duration) -> Pose {
    let t = at.as_secs_f64();
    Pose {
        position: [500.0 + 100.0 * t.cos(), 100.0 * t.sin(), 300.0 + 20.0 * (0.5 * t).sin()],
        wpr: [180.0 - 10.0 * (0.7 * t).sin(), 5.0 * t.sin(), 45.0 + 20.0 * (0.3 * t).cos()],
    }
}

/// What the controller shows over Modbus. Signal n of a table of inputs is on where n is a multiple of 3, a register of inputs
/// holds its address as Table 1 counts it, R\[n\] holds n: so a client sees at once whether it is off by one.
#[allow(missing_debug_implementations, reason = "a motion is a function")]
pub struct Controller {
    motion: Motion,
    faults: Faults,
    now: Duration,
    /// The run that the background task has done last.
    run: Option<u32>,
    discrete_inputs: Vec<bool>,
    coils: Vec<bool>,
    input_registers: Vec<u16>,
    holding_registers: Vec<u16>,
    order: WordOrder,
}

impl Controller {
    /// A controller that has just been switched on.
    pub fn new(motion: Motion, order: WordOrder) -> Self {
        let numbers = |table| (1..=used(table)).map(|n| u16::try_from(n).unwrap_or_default());
        Self {
            motion,
            faults: Faults::default(),
            now: Duration::ZERO,
            run: None,
            discrete_inputs: numbers(Table::DiscreteInputs).map(|n| n % 3 == 0).collect(),
            coils: vec![false; used(Table::Coils)],
            input_registers: numbers(Table::InputRegisters).collect(),
            holding_registers: numbers(Table::HoldingRegisters)
                .map(|n| match Signal::at(Table::HoldingRegisters, n - 1) {
                    Some(Signal::R(n)) => n,
                    _ => 0,
                })
                .collect(),
            order,
        }
    }

    /// The same with faults.
    #[must_use]
    pub fn with_faults(mut self, faults: Faults) -> Self {
        self.faults = faults;
        self
    }

    /// Whether clients cannot reach it now.
    pub fn is_away(&self, now: Duration) -> bool {
        self.faults.has(Fault::Disconnect, now)
    }

    /// Lets the background task run as often as it is due. What a client wrote to its registers is gone then.
    pub fn tick(&mut self, now: Duration) {
        self.now = now;
        if self.faults.has(Fault::Standstill, now) && self.run.is_some() {
            return;
        }
        let run = runs(now);
        if self.run.replace(run) == Some(run) {
            return;
        }
        let block = self.block(run);
        let registers = block.to_registers(self.order);
        if let Some(area) = self.holding_registers.first_chunk_mut() {
            *area = registers;
        }
    }

    /// What the background task writes at the period `run` since the start.
    pub fn block(&self, run: u32) -> TelemetryBlock {
        let at = PERIOD * run;
        let pose = |run: u32| (self.motion)(PERIOD * run);
        let counter = runs(self.faults.task_time(at));
        let mut block = background_task(counter, &pose(run), &pose(run.saturating_sub(1)));
        self.faults.spoil(&mut block, at);
        block
    }

    /// The exception of a controller that is busy.
    fn ready(&self) -> Result<(), Exception> {
        if self.faults.has(Fault::Busy, self.now) { Err(Exception::ServerDeviceBusy) } else { Ok(()) }
    }
}

/// The periods in this time.
fn runs(time: Duration) -> u32 {
    u32::try_from(time.as_millis() / PERIOD.as_millis()).unwrap_or(u32::MAX)
}

/// One run of the task, line by line as Fig. 8 has it: single precision, Q1 made positive, differences over 0.008 s.
#[expect(clippy::cast_possible_truncation, reason = "the controller's registers are of single precision")]
pub fn background_task(counter: u32, pose: &Pose, before: &Pose) -> TelemetryBlock {
    let single = |values: [f64; 3]| values.map(|value| value as f32);
    let (position, position_before) = (single(pose.position), single(before.position));
    let (q, q_before) = (quaternion(pose.wpr), quaternion(before.wpr));
    let speed = |now: f32, before: f32| (now - before) / 0.008;
    let [x, y, z] = position;
    let [px, py, pz] = position_before;
    let mut quaternion_rate = q;
    for (rate, before) in quaternion_rate.iter_mut().zip(q_before) {
        *rate = speed(*rate, before);
    }
    TelemetryBlock {
        life_counter: counter,
        override_percent: 100,
        position,
        wpr: single(pose.wpr),
        quaternion: q,
        velocity: [speed(x, px), speed(y, py), speed(z, pz)],
        quaternion_rate,
    }
}

/// Lines 16 to 36: the quaternion of W, P, R, with its first part made positive.
#[expect(clippy::cast_possible_truncation, reason = "the controller's registers are of single precision")]
fn quaternion([w, p, r]: [f64; 3]) -> [f32; 4] {
    let ((sr, cr), (sp, cp), (sy, cy)) = (
        (w / 2.0).to_radians().sin_cos(),
        (p / 2.0).to_radians().sin_cos(),
        (r / 2.0).to_radians().sin_cos(),
    );
    let q = [
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    ];
    let sign = if q.first().is_some_and(|q1| *q1 < 0.0) { -1.0 } else { 1.0 };
    q.map(|part| (sign * part) as f32)
}

/// How many addresses of a table are used: all from 0 on.
fn used(table: Table) -> usize {
    match table {
        Table::DiscreteInputs => 28_000,
        Table::Coils => 30_000,
        Table::InputRegisters => 4000,
        Table::HoldingRegisters => 16_448,
    }
}

fn run<T>(all: &[T], address: u16, len: usize) -> Result<&[T], Exception> {
    all.get(address.into()..usize::from(address) + len).ok_or(Exception::IllegalDataAddress)
}

fn run_mut<T>(all: &mut [T], address: u16, len: usize) -> Result<&mut [T], Exception> {
    all.get_mut(address.into()..usize::from(address) + len).ok_or(Exception::IllegalDataAddress)
}

fn show(bits: &[bool], out: &mut BitsMut<'_>) {
    for (index, bit) in bits.iter().enumerate() {
        out.set(index, *bit);
    }
}

impl Registers for Controller {
    fn read_coils(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        self.ready()?;
        show(run(&self.coils, address, out.len())?, out);
        Ok(())
    }

    fn read_discrete_inputs(&mut self, address: u16, out: &mut BitsMut<'_>) -> Result<(), Exception> {
        self.ready()?;
        show(run(&self.discrete_inputs, address, out.len())?, out);
        Ok(())
    }

    fn read_holding_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.ready()?;
        out.copy_from(run(&self.holding_registers, address, out.len())?);
        Ok(())
    }

    fn read_input_registers(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        self.ready()?;
        out.copy_from(run(&self.input_registers, address, out.len())?);
        Ok(())
    }

    fn write_coils(&mut self, address: u16, values: Bits<'_>) -> Result<(), Exception> {
        self.ready()?;
        values.copy_to(run_mut(&mut self.coils, address, values.len())?);
        Ok(())
    }

    fn write_registers(&mut self, address: u16, values: Words<'_>) -> Result<(), Exception> {
        self.ready()?;
        values.copy_to(run_mut(&mut self.holding_registers, address, values.len())?);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_end_where_table_1_says_not_used() {
        for table in [Table::DiscreteInputs, Table::Coils, Table::InputRegisters, Table::HoldingRegisters] {
            let end = u16::try_from(used(table)).unwrap();
            assert!(Signal::at(table, end - 1).is_some(), "{table:?}");
            assert_eq!(Signal::at(table, end), None, "{table:?}");
        }
    }

    #[test]
    fn the_task_computes_what_the_worked_values_say() {
        let pose = |wpr| Pose { position: [0.0; 3], wpr };
        let close = |wpr, expected: [f32; 4]| {
            let q = background_task(1, &pose(wpr), &pose(wpr)).quaternion;
            assert!(
                q.iter().zip(expected).all(|(q, expected)| (q - expected).abs() < 6e-8),
                "{wpr:?}: {q:?}"
            );
        };
        close([10.0, 20.0, 30.0], [0.951_548_5, 0.038_134_6, 0.189_307_9, 0.239_298_3]);
        // -0.5211695, -0.3779911, -0.6328781, 0.4300817 before the flip.
        close([-120.0, 80.0, 170.0], [0.521_169_5, 0.377_991_1, 0.632_878_1, -0.430_081_7]);
    }

    #[test]
    fn the_flip_makes_the_false_speed_that_the_source_computes() {
        let pose = |r| Pose { position: [0.0; 3], wpr: [0.0, 0.0, r] };
        let block = background_task(2, &pose(180.1), &pose(179.9));
        assert!((block.quaternion_rate[3] + 249.999).abs() < 0.01, "{:?}", block.quaternion_rate);
    }

    #[test]
    fn the_task_overwrites_its_registers_at_its_next_run_and_no_others() {
        let mut controller = Controller::new(Box::new(circle), WordOrder::LowFirst);
        controller.tick(Duration::from_millis(80));
        controller.write_registers(35, Words::from(&[1, 2, 3, 4])).unwrap();
        controller.tick(Duration::from_millis(87));
        assert_eq!(controller.holding_registers[35..39], [1, 2, 3, 4]);
        controller.tick(Duration::from_millis(88));
        assert_ne!(controller.holding_registers[35..37], [1, 2]);
        assert_eq!(controller.holding_registers[37..39], [3, 4]);
        assert_eq!(controller.holding_registers[..3], [11, 0, 100]);
        assert_eq!(controller.holding_registers[39..41], [40, 41]);
    }
}
