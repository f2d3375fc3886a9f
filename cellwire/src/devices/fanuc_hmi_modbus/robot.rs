//! The robot of the simulated controller: one that moves on a circle, or one that runs a program.

use std::ops::Range;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use cellwire_sim::fanuc::{Pose, Program, Tables, TelemetryFaults, background_task};
use fanuc_hmi_modbus::TelemetryBlock;
use serde_json::Value;

use super::inputs::Inputs;
use super::mapping::Mapping;
use super::program::{Machine, RobotPosition};

/// A robot that runs a program, and the view of it in its controller.
#[derive(Debug)]
pub struct Robot {
    /// The machine that runs the program.
    pub machine: Machine,
    /// The mapping of the holding registers.
    pub mapping: Mapping,
    /// The signals that come from outside.
    pub inputs: Inputs,
    /// The first register of the background task; 0 without one.
    pub telemetry: u32,
    before: Option<Pose>,
}

impl Robot {
    /// Creates a robot at the beginning of its program.
    pub fn new(machine: Machine, mapping: Mapping, inputs: Inputs, telemetry: u32) -> Self {
        Self { machine, mapping, inputs, telemetry, before: None }
    }

    /// Goes on for one period of the background task, which ends at `at`, its run of this number.
    pub fn run(&mut self, at: Duration, number: u32, faults: &TelemetryFaults, tables: &mut Tables) {
        self.inputs.set(at, tables);
        self.machine.advance(at.as_secs_f64(), tables);
        let pose = self.machine.pose();
        let [x, y, z, w, p, r] = pose.to_xyzwpr();
        let pose = Pose { position: [x, y, z], wpr: [w, p, r] };
        let before = self.before.replace(pose).unwrap_or(pose);
        if self.telemetry == 0 {
            return;
        }
        let mut block = background_task(number, &pose, &before);
        #[expect(clippy::cast_possible_truncation, reason = "0 to 100")]
        let percent = self.machine.override_percent().round() as i16;
        block.override_percent = percent;
        faults.spoil(&mut block, at);
        let TelemetryBlock {
            life_counter,
            override_percent,
            position,
            wpr,
            quaternion,
            velocity,
            quaternion_rate,
        } = block;
        let reals = position.iter().chain(&wpr).chain(&quaternion).chain(&velocity).chain(&quaternion_rate);
        let counted = [f64::from(life_counter), f64::from(override_percent)];
        let values = counted.into_iter().chain(reals.map(|real| f64::from(*real)));
        self.machine.memory.numbers.extend((self.telemetry..).zip(values));
    }

    /// Puts all variables into the holding registers.
    pub fn show(&mut self, tables: &mut Tables) {
        let here = RobotPosition::Cartesian { xyzwpr: self.machine.pose().to_xyzwpr(), folded: None };
        self.mapping.show(&self.machine.memory, &here, &mut tables.holding_registers);
    }
}

/// The reports of a program, for the thread that takes them.
pub type Reports = Arc<Mutex<Vec<Value>>>;

/// A robot in a controller that serves clients.
#[derive(Debug)]
pub struct ReportingRobot {
    /// The robot that runs a program.
    pub robot: Robot,
    /// The reports of its program.
    pub reports: Reports,
}

impl Program for ReportingRobot {
    fn run(&mut self, at: Duration, number: u32, faults: &TelemetryFaults, tables: &mut Tables) {
        self.robot.run(at, number, faults, tables);
        self.reports.lock().unwrap_or_else(PoisonError::into_inner).extend(self.robot.machine.events());
    }

    fn written(&mut self, registers: Range<usize>, tables: &Tables) {
        let Robot { mapping, machine, .. } = &mut self.robot;
        mapping.take(registers, &tables.holding_registers, &mut machine.memory);
    }

    fn show(&mut self, tables: &mut Tables) {
        self.robot.show(tables);
    }

    fn register(&self, number: u16) -> Option<u16> {
        self.robot.mapping.register(number)
    }
}
