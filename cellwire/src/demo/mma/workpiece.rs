//! The parts of the simulated cell, and the vacuum that holds them: sometimes one is missed, sometimes one falls on the way.

use std::time::Duration;

use mmacell_proto::{BLOW, PlatformPose, RobotPose, VACUUM};

/// The largest distance in µm at which the gripper reaches the part: it is soft, and is compressed by this length at most.
const CONTACT_UM: f64 = 8_000.0;
/// The largest distance in µm at which a part may be put down beside its place.
const PLACE_UM: f64 = 10.0;
/// The probabilities that a part is missed, and that one falls.
const MISSED: f64 = 0.08;
const FALLS: f64 = 0.08;

/// One part after the other: on the feeder, on the gripper, in its place.
#[derive(Debug)]
pub struct Workpieces {
    rng: fastrand::Rng,
    part: Part,
    holds: GripperLoad,
    fate: AttemptOutcome,
    vacuum: bool,
    blow: bool,
    /// When the part fell whose vacuum is still on.
    fell: Option<Duration>,
    /// The record for the verdict and the picture.
    pub record: Record,
}

/// The record of the parts.
#[derive(Debug, Default)]
pub struct Record {
    /// Parts that left their place again with the gripper, because nothing blew them off. Never, if step 21 is right.
    pub carried_off: u64,
    /// The longest time for which the vacuum was on without its part after a fall, in cell time.
    pub vacuum_after_fall: Duration,
    /// The levels of the vacuum valve, each with the time at which it began.
    pub vacuum: Vec<(Duration, bool)>,
    /// The levels of the blow-off valve, each with the time at which it began.
    pub blow: Vec<(Duration, bool)>,
    /// The levels of the vacuum switch, each with the time at which it began.
    pub switch: Vec<(Duration, bool)>,
    /// The time and the outcome of each attempt.
    pub outcomes: Vec<(Duration, Outcome)>,
}

/// The outcome of an attempt.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// The part is in its place, and blown off the gripper.
    Placed,
    /// The gripper did not catch the part.
    Missed,
    /// The part fell on the way.
    Lost,
    /// The part was let go elsewhere than in its place: the task was stopped by a fault.
    Dropped,
}

impl Record {
    /// Returns the number of attempts with this outcome.
    pub fn count(&self, outcome: Outcome) -> u64 {
        self.outcomes.iter().filter(|(_, known)| *known == outcome).count() as u64
    }
}

#[derive(Debug, Clone, Copy)]
struct Part {
    platform: PlatformPose,
    pick: RobotPose,
    place: RobotPose,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum GripperLoad {
    /// The part is on the feeder.
    Nothing,
    /// The part is on the gripper.
    Part,
    /// The part is in its place, and the gripper still sticks to it.
    Sticks,
}

/// The intended outcome of an attempt.
#[derive(Debug, Clone, Copy, PartialEq)]
enum AttemptOutcome {
    Good,
    Missed,
    /// After this share of the way.
    Falls(f64),
}

impl Workpieces {
    /// Parts whose poses and fates follow from `seed`.
    pub fn new(seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(seed);
        let part = Part::next(&mut rng, 0);
        let (vacuum, blow, fell) = (false, false, None);
        Self {
            rng,
            part,
            holds: GripperLoad::Nothing,
            fate: AttemptOutcome::Good,
            vacuum,
            blow,
            fell,
            record: Record::default(),
        }
    }

    /// Returns the view of camera 1: the pose of the platform for this part, and the pose of the part.
    pub fn part(&self) -> (PlatformPose, RobotPose) {
        (self.part.platform, self.part.pick)
    }

    /// Returns the view of camera 2: the place of the part.
    pub fn place(&self) -> RobotPose {
        self.part.place
    }

    /// Returns the state of the vacuum switch: high if a part closes the gripper.
    pub fn switch(&self) -> bool {
        self.vacuum && self.holds != GripperLoad::Nothing
    }

    /// Returns whether the vacuum is on.
    pub fn vacuum(&self) -> bool {
        self.vacuum
    }

    /// Moves the gripper here.
    pub fn move_to(&mut self, now: Duration, gripper: RobotPose) {
        let (from_pick, from_place) = (distance(gripper, self.part.pick), distance(gripper, self.part.place));
        match (self.holds, self.fate) {
            (GripperLoad::Nothing, AttemptOutcome::Good | AttemptOutcome::Falls(_))
                if self.vacuum && self.fell.is_none() && from_pick <= CONTACT_UM =>
            {
                self.holds = GripperLoad::Part;
            }
            (GripperLoad::Part, AttemptOutcome::Falls(share))
                if from_pick >= share * distance(self.part.pick, self.part.place) =>
            {
                self.holds = GripperLoad::Nothing;
                self.record.outcomes.push((now, Outcome::Lost));
                self.fell = Some(now);
            }
            (GripperLoad::Sticks, _) if from_place > PLACE_UM => {
                self.holds = GripperLoad::Nothing;
                self.record.carried_off += 1;
            }
            _ => {}
        }
        if let Some(fell) = self.fell {
            self.record.vacuum_after_fall = self.record.vacuum_after_fall.max(now.saturating_sub(fell));
        }
        self.note_switch(now);
    }

    /// Sets a valve while the gripper is here; returns whether that leaves the part in its place.
    pub fn set_valve(&mut self, now: Duration, valve: i32, open: bool, gripper: RobotPose) -> bool {
        self.move_to(now, gripper);
        let mut is_placed = false;
        match valve {
            VACUUM if open && !self.vacuum => {
                (self.vacuum, self.fell) = (true, None);
                self.fate = match self.rng.f64() {
                    chance if chance < MISSED => AttemptOutcome::Missed,
                    chance if chance < MISSED + FALLS => AttemptOutcome::Falls(0.1 + 0.8 * self.rng.f64()),
                    _ => AttemptOutcome::Good,
                };
                self.record.vacuum.push((now, true));
            }
            VACUUM if !open && self.vacuum => {
                self.vacuum = false;
                self.let_go(now, gripper);
                self.record.vacuum.push((now, false));
            }
            BLOW if open != self.blow => {
                self.blow = open;
                self.record.blow.push((now, open));
                if open && self.holds == GripperLoad::Sticks {
                    is_placed = true;
                    self.holds = GripperLoad::Nothing;
                    self.record.outcomes.push((now, Outcome::Placed));
                    self.part = Part::next(&mut self.rng, self.record.count(Outcome::Placed));
                }
            }
            _ => {}
        }
        self.note_switch(now);
        is_placed
    }

    fn let_go(&mut self, now: Duration, gripper: RobotPose) {
        if self.fell.take().is_some() {
            return; // it lies on the feeder again
        }
        match self.holds {
            GripperLoad::Part if distance(gripper, self.part.place) <= PLACE_UM => {
                self.holds = GripperLoad::Sticks
            }
            GripperLoad::Part => {
                self.holds = GripperLoad::Nothing;
                self.record.outcomes.push((now, Outcome::Dropped));
            }
            GripperLoad::Nothing => {
                self.record.outcomes.push((now, Outcome::Missed));
            }
            GripperLoad::Sticks => {}
        }
    }

    fn note_switch(&mut self, now: Duration) {
        let high = self.switch();
        if self.record.switch.last().map_or(high, |(_, last)| *last != high) {
            self.record.switch.push((now, high));
        }
    }
}

impl Part {
    /// Returns the next part, anywhere on the feeder, for the next of 36 positions on the fixture.
    fn next(rng: &mut fastrand::Rng, number: u64) -> Self {
        let mut between = |low: f64, high: f64| low + (high - low) * rng.f64();
        let platform = PlatformPose::from_rad(between(-0.6, 0.6), between(-0.6, 0.6));
        let pick =
            RobotPose::from_mm_rad(between(-150.0, -90.0), between(-50.0, 50.0), 5.0, between(-1.5, 1.5));
        #[expect(clippy::cast_precision_loss, reason = "0 to 5")]
        let (column, row) = ((number % 6) as f64, (number / 6 % 6) as f64);
        let place = RobotPose::from_mm_rad(100.0 + 10.0 * column, -30.0 + 12.0 * row, 8.0, 0.0);
        Self { platform, pick, place }
    }
}

/// Returns the distance of two poses of the gripper, in micrometres.
fn distance(a: RobotPose, b: RobotPose) -> f64 {
    let along = |a: mmacell_proto::Length, b: mmacell_proto::Length| f64::from(a.um() - b.um()).powi(2);
    (along(a.x, b.x) + along(a.y, b.y) + along(a.z, b.z)).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const AT: fn(u64) -> Duration = Duration::from_millis;

    fn parts(fate: AttemptOutcome) -> Workpieces {
        let mut parts = Workpieces::new(1);
        let pick = parts.part().1;
        parts.set_valve(AT(1), VACUUM, true, RobotPose::ORIGIN);
        parts.fate = fate;
        parts.move_to(AT(2), pick);
        parts
    }

    #[test]
    fn a_part_is_placed_where_it_belongs_and_only_when_it_is_blown_off() {
        let mut parts = parts(AttemptOutcome::Good);
        assert!(parts.switch());
        let place = parts.place();
        parts.move_to(AT(3), place);
        parts.set_valve(AT(4), VACUUM, false, place);
        assert_eq!((parts.switch(), parts.record.count(Outcome::Placed)), (false, 0));
        parts.set_valve(AT(5), BLOW, true, place);
        assert_eq!(parts.record.count(Outcome::Placed), 1);
        assert_ne!(parts.place(), place);
    }

    #[test]
    fn a_part_that_nothing_blows_off_leaves_with_the_gripper() {
        let mut parts = parts(AttemptOutcome::Good);
        let place = parts.place();
        parts.set_valve(AT(4), VACUUM, false, place);
        parts.move_to(AT(5), RobotPose::ORIGIN);
        assert_eq!((parts.record.count(Outcome::Placed), parts.record.carried_off), (0, 1));
    }

    #[test]
    fn a_part_falls_on_its_way_and_the_time_until_the_vacuum_is_off_is_known() {
        let mut parts = parts(AttemptOutcome::Falls(0.5));
        let place = parts.place();
        assert!(parts.switch());
        parts.move_to(AT(10), place);
        assert_eq!((parts.switch(), parts.vacuum(), parts.record.count(Outcome::Lost)), (false, true, 1));
        parts.set_valve(AT(30), VACUUM, false, place);
        assert_eq!(parts.record.vacuum_after_fall, AT(20));
        assert_eq!((parts.record.count(Outcome::Missed), parts.record.count(Outcome::Dropped)), (0, 0));
    }

    #[test]
    fn a_part_is_missed_or_dropped() {
        let mut missed = parts(AttemptOutcome::Missed);
        assert!(!missed.switch());
        missed.set_valve(AT(3), VACUUM, false, RobotPose::ORIGIN);
        assert_eq!(missed.record.count(Outcome::Missed), 1);
        let mut dropped = parts(AttemptOutcome::Good);
        dropped.set_valve(AT(3), VACUUM, false, RobotPose::ORIGIN);
        assert_eq!(dropped.record.outcomes, [(AT(3), Outcome::Dropped)]);
    }
}
