//! Motions: where they go, how fast, and how close they come.

use fanuc_ls::{
    Expression, Index, Item, ItemKind, Motion, MotionKind, Operation, Speed, SpeedUnit, Target, Termination,
};
use serde_json::json;

use super::super::load::{LoadedProgram, Step, curves};
use super::super::memory::{Fault, Value};
use super::super::position::RobotPosition;
use super::{FASTEST, Flow, Machine, PERIOD, RAMP, parsed};
use cellwire_motion::{Goal, Kinematics as _, Move, MoveError, Pace, PathKind, Pose};
use cellwire_sim::fanuc::Tables;

impl Machine {
    pub(super) fn motion(
        &mut self,
        motion: &Motion,
        loaded: &LoadedProgram,
        tables: &mut Tables,
    ) -> Result<Flow, Fault> {
        let skip = motion.each_option().into_iter().find_map(skip_of);
        let skips = skip.is_some();
        if let (Some(end), Some((label, keeps))) = (self.skipping, skip) {
            return self.watch(end, label, keeps, loaded, tables);
        }
        if curves(motion) && !self.planner.goes_anywhere() {
            return self.spline(loaded, tables);
        }
        let (place, frame, tool) = self.place(&motion.target, loaded, tables)?;
        if !self.takes(tool) {
            return Ok(Flow::Again(self.rest));
        }
        let frame = self.user_frame(frame);
        let mut goal = place.goal(frame);
        let is_bare = motion.each_option().contains(&"Offset");
        let of_condition = || self.offset.clone().ok_or("Offset without an OFFSET CONDITION");
        let offset = if is_bare { Some(of_condition()?) } else { motion.offset() };
        if let Some(item) = offset {
            let [x, y, z, ..] = *self.register(&item, loaded, tables)?.parts();
            let moved = match goal {
                Goal::Pose(pose, folded) => Some(Goal::Pose(
                    frame.then(Pose::shift(x, y, z)).then(frame.inverse()).then(pose),
                    folded,
                )),
                Goal::Joints(_) => None,
            };
            goal = moved.ok_or("an offset to a position in joints is not modelled")?;
        }
        if let Some(item) = motion.tool_offset() {
            let offset = Pose::from_xyzwpr(*self.register(&item, loaded, tables)?.parts());
            let Goal::Pose(pose, folded) = goal else {
                return Err("an offset to a position in joints is not modelled".into());
            };
            goal = Goal::Pose(pose.then(offset), folded);
        }
        let way = match (motion.kind, &motion.via) {
            (MotionKind::Joint, _) => PathKind::Joint,
            (MotionKind::Circular, Some(via)) => {
                let (via, frame, _) = self.place(via, loaded, tables)?;
                match via.goal(self.user_frame(frame)) {
                    Goal::Pose(pose, _) => PathKind::Arc(pose.position),
                    Goal::Joints(joints) => PathKind::Arc(self.planner.arm().forward(&joints).position),
                }
            }
            _ => PathKind::Linear,
        };
        let pace = self.pace(&motion.speed, loaded, tables)?;
        let blend = match &motion.termination {
            None | Some(Termination::Fine) => 0.0,
            Some(Termination::Continuous(percent)) => f64::from(*percent) / 100.0,
            Some(Termination::ContinuousRegister(register)) => {
                self.number_of(register, loaded, tables)?.clamp(0.0, 100.0) / 100.0
            }
        };
        let ramp = RAMP / acceleration(&motion.each_option());
        let motion = Move { goal, way, pace, ramp, blend: if skips { 0.0 } else { blend } };
        let (next, end) = self.planner.add(self.now, &motion).map_err(|error| self.fault(error))?;
        self.rest = self.rest.max(end);
        if skips {
            self.skipping = Some(end);
            return Ok(Flow::Again(self.now + PERIOD));
        }
        Ok(Flow::Later(next))
    }

    /// Executes the next S motion. The first one begins a curve through it and the following ones, at whose beginning and
    /// end the arm is at rest.
    fn spline(&mut self, loaded: &LoadedProgram, tables: &mut Tables) -> Result<Flow, Fault> {
        if self.curve.is_empty() {
            if self.now < self.rest {
                return Ok(Flow::Again(self.rest));
            }
            let first = self.stack.last().map_or(0, |frame| frame.next);
            let (mut goals, mut common) = (Vec::new(), None);
            for step in loaded.steps.iter().skip(first) {
                let Step::Motion(motion) = step else { break };
                if !curves(motion) {
                    break;
                }
                let (place, frame, tool) = self.place(&motion.target, loaded, tables)?;
                if *common.get_or_insert(tool) != tool {
                    break;
                }
                goals.push((place.goal(self.user_frame(frame)), self.pace(&motion.speed, loaded, tables)?));
            }
            self.takes(common.unwrap_or(0));
            let times = self.planner.add_spline(self.now, &goals).map_err(|error| self.fault(error))?;
            self.curve = times.into();
        }
        let end = self.curve.pop_front().unwrap_or(self.now);
        self.rest = self.rest.max(end);
        Ok(Flow::Later(end))
    }

    /// Changes the tool; false if the arm must come to rest before.
    fn takes(&mut self, tool: u32) -> bool {
        let frame = self.memory.frames.get(&(true, tool));
        let frame = frame.map_or(Pose::IDENTITY, |tool| Pose::from_xyzwpr(*tool));
        if self.planner.arm().tool != frame {
            if self.now < self.rest {
                return false;
            }
            self.planner.set_tool(frame);
        }
        true
    }

    fn fault(&self, error: MoveError) -> Fault {
        match error {
            MoveError::Unreachable { .. } | MoveError::Joint { .. } => {
                format!("{error}: it is {}", self.robot)
            }
            error => error.to_string(),
        }
    }

    /// Executes a motion with Skip: its condition ends it, and the next line follows; otherwise its label follows when the
    /// motion has ended.
    fn watch(
        &mut self,
        end: f64,
        label: Item,
        keeps: Option<Operation>,
        loaded: &LoadedProgram,
        tables: &mut Tables,
    ) -> Result<Flow, Fault> {
        let condition = self.skip.clone().ok_or("Skip without a SKIP CONDITION")?;
        if self.with(loaded, tables, |memory, tables, around| memory.bit(&condition, tables, around))? {
            self.planner.halt(self.now);
            (self.rest, self.skipping) = (self.now, None);
            if let Some(keeps) = keeps {
                self.operate(&keeps, loaded, tables)?;
            }
            return Ok(Flow::Next);
        }
        if self.now < end {
            return Ok(Flow::Again(end.min(self.now + PERIOD)));
        }
        self.skipping = None;
        self.jump(&label, loaded, tables)
    }

    fn pace(&mut self, speed: &Speed, loaded: &LoadedProgram, tables: &mut Tables) -> Result<Pace, Fault> {
        let (value, unit) = match speed {
            Speed::Fixed { value, unit } => (*value, *unit),
            Speed::Register { register, unit } => (self.number_of(register, loaded, tables)?, *unit),
            Speed::Named(_) => (FASTEST, SpeedUnit::MmPerSec),
        };
        if value <= 0.0 {
            return Err(format!("a speed of {value}"));
        }
        let speed = self.speed;
        Ok(match unit {
            SpeedUnit::Percent => Pace::Share(value / 100.0 * speed),
            SpeedUnit::Sec => Pace::Time(value / speed),
            SpeedUnit::Msec => Pace::Time(value / 1000.0 / speed),
            SpeedUnit::MmPerSec => Pace::Path(value * speed),
            SpeedUnit::CmPerMin => Pace::Path(value / 6.0 * speed),
            SpeedUnit::InchPerMin => Pace::Path(value * 25.4 / 60.0 * speed),
            SpeedUnit::DegPerSec => Pace::Turn(value * speed),
        })
    }

    /// Returns a position with its user frame and tool.
    fn place(
        &mut self,
        target: &Target,
        loaded: &LoadedProgram,
        tables: &mut Tables,
    ) -> Result<(RobotPosition, u32, u32), Fault> {
        let item = match target {
            Target::Position { number, .. } => item(ItemKind::Position, *number),
            Target::Register { number, .. } => item(ItemKind::PositionRegister, *number),
            Target::Other(text) => parsed(text).ok_or_else(|| format!("{text} is not modelled"))?,
        };
        let place = self.register(&item, loaded, tables)?;
        let (mut frame, mut tool) = (self.frame.unwrap_or(0), self.tool.unwrap_or(0));
        if item.kind == ItemKind::Position {
            let number = self
                .with(loaded, tables, |memory, tables, around| memory.index(&item.index, tables, around))?;
            let group = loaded.program.position(number).and_then(|position| position.groups.first());
            let of = (group.and_then(|group| group.user_frame), group.and_then(|group| group.user_tool));
            self.assume(number, of);
            frame = fitting(number, ("UFRAME", of.0.map(u32::from)), self.frame)?.unwrap_or(frame);
            tool = fitting(number, ("UTOOL", of.1.map(u32::from)), self.tool)?.unwrap_or(tool);
        }
        Ok((place, frame, tool))
    }

    /// Selects the frames of the first position if no frames are selected.
    fn assume(&mut self, number: u32, (frame, tool): (Option<u16>, Option<u16>)) {
        let mut assumed = Vec::new();
        for (name, of, selected) in [("UFRAME", frame, &mut self.frame), ("UTOOL", tool, &mut self.tool)] {
            if let (Some(of), None) = (of, *selected) {
                *selected = Some(of.into());
                assumed.push(format!("{name}_NUM={of}"));
            }
        }
        if !assumed.is_empty() {
            let what = format!("{}, as in P[{number}], without a selection", assumed.join(" and "));
            self.event("assumed", &json!({"what": what}));
        }
    }

    pub(super) fn register(
        &mut self,
        item: &Item,
        loaded: &LoadedProgram,
        tables: &mut Tables,
    ) -> Result<RobotPosition, Fault> {
        let found = self.with(loaded, tables, |memory, tables, around| memory.read(item, tables, around))?;
        match found {
            Value::Place(place) => Ok(place),
            other => Err(format!("{other:?} is not a position")),
        }
    }

    pub(super) fn number_of(
        &mut self,
        register: &str,
        loaded: &LoadedProgram,
        tables: &mut Tables,
    ) -> Result<f64, Fault> {
        let item = parsed(register).ok_or_else(|| format!("{register} is not modelled"))?;
        let value = Expression::Item(item);
        self.with(loaded, tables, |memory, tables, around| memory.number(&value, tables, around))
    }
}

fn item(kind: ItemKind, number: u32) -> Item {
    Item { kind, group: None, index: Index::Number(number), element: None, name: None }
}

/// Returns the frame of a position, if it has one; a fault unless it is the selected one, because a controller stops then.
fn fitting(
    number: u32,
    (kind, of): (&str, Option<u32>),
    selected: Option<u32>,
) -> Result<Option<u32>, Fault> {
    match (of, selected) {
        (Some(of), Some(selected)) if of != selected => {
            Err(format!("P[{number}] is of {kind} {of}, and {kind}_NUM={selected} is selected"))
        }
        _ => Ok(of),
    }
}

/// Returns the label of `Skip,LBL[1],PR[2]=LPOS`, and the operation when the condition is true.
fn skip_of(option: &str) -> Option<(Item, Option<Operation>)> {
    let (word, rest) = option.split_once(',')?;
    if !["Skip", "Interrupt"].iter().any(|name| name.eq_ignore_ascii_case(word.trim())) {
        return None;
    }
    let end = rest.find(']')? + 1;
    let (label, keeps) = rest.split_at_checked(end)?;
    Some((parsed(label.trim())?, keeps.trim_start().strip_prefix(',').and_then(Operation::decode)))
}

/// Returns the share of `ACC50`.
fn acceleration(options: &[&str]) -> f64 {
    let percent = options.iter().find_map(|word| word.strip_prefix("ACC")?.trim().parse::<f64>().ok());
    (percent.unwrap_or(100.0) / 100.0).clamp(0.01, 5.0)
}
