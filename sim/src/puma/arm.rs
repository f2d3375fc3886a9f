//! The simulated arm: increments become rotations and add up.

use val2_alter::{AXES, Accumulation, Mode, Polarity, Scale, Transform};

use super::layout::Layout;
use super::pose::Pose;

/// The robot that ALTER moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ArmConfig {
    /// The polarity of mode bit 1.
    pub polarity: Polarity,
    /// The units of the robot's words.
    pub scale: Scale,
    /// The layout of the transformations that it sends.
    pub layout: Layout,
    /// The pose of the arm at first.
    pub home: Pose,
}

impl Default for ArmConfig {
    /// Returns the source's robot, with the tool pointing down in front of it.
    fn default() -> Self {
        Self {
            polarity: Polarity::default(),
            scale: Scale::PUMA_562,
            layout: Layout::COLUMNS,
            home: Pose { n: [1.0, 0.0, 0.0], o: [0.0, -1.0, 0.0], a: [0.0, 0.0, -1.0], p: [400.0, 0.0, 0.0] },
        }
    }
}

/// An arm on the path of its program, with the corrections of ALTER on top of it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Arm {
    config: ArmConfig,
    mode: Mode,
    path: Pose,
    correction: Pose,
}

impl Arm {
    /// Creates an arm at home, for an ALTER instruction of this mode.
    pub(super) fn new(config: ArmConfig, mode: Mode) -> Self {
        Self { config, mode, path: config.home, correction: Pose::IDENTITY }
    }

    /// Begins ALTER: the path is the current position of the arm (the source's program has `MOVES HERE`).
    pub(super) fn begin(&mut self) {
        (self.path, self.correction) = (self.pose(), Pose::IDENTITY);
    }

    /// Takes the values of a reply.
    pub(super) fn take(&mut self, values: [i16; AXES]) {
        let set = Pose::from_values(values, &self.config.scale);
        self.correction = match self.mode.accumulation() {
            Accumulation::Cumulative => {
                self.correction.accumulated(&set, self.mode.frame(self.config.polarity))
            }
            Accumulation::NonCumulative => set,
        };
    }

    /// Returns the pose of the arm: the path with all corrections.
    pub(super) fn pose(&self) -> Pose {
        self.path.corrected(&self.correction, self.mode.frame(self.config.polarity))
    }

    /// Returns the pose in the words of a standard message.
    pub(super) fn transform(&self) -> Transform {
        self.config.layout.words(&self.pose())
    }
}

#[cfg(test)]
#[allow(clippy::indexing_slicing)]
mod tests {
    use val2_alter::CoordinateFrame;

    use super::super::layout::Order;
    use super::*;

    /// Rounds to the nearest 1/1000, so that quarter turns are whole numbers.
    fn rounded(pose: &Pose) -> [[i64; 3]; 4] {
        #[allow(clippy::cast_possible_truncation)]
        [pose.n, pose.o, pose.a, pose.p].map(|v| v.map(|x| (x * 1000.0).round() as i64))
    }

    const QUARTER: i16 = 16384;

    #[test]
    fn a_quarter_turn_about_each_axis() {
        let turn = |rx, ry, rz| rounded(&Pose::from_values([32, 64, 96, rx, ry, rz], &Scale::PUMA_562));
        let p = [1000, 2000, 3000];
        assert_eq!(turn(QUARTER, 0, 0), [[1000, 0, 0], [0, 0, 1000], [0, -1000, 0], p]);
        assert_eq!(turn(0, QUARTER, 0), [[0, 0, -1000], [0, 1000, 0], [1000, 0, 0], p]);
        assert_eq!(turn(0, 0, QUARTER), [[0, 1000, 0], [-1000, 0, 0], [0, 0, 1000], p]);
        // About x, then about the world's y, then about the world's z.
        let all = Pose::from_values([0, 0, 0, QUARTER, QUARTER, QUARTER], &Scale::PUMA_562);
        let [x, y, z] = [0, 1, 2].map(|axis| {
            let mut values = [0; 6];
            values[3 + axis] = QUARTER;
            Pose::from_values(values, &Scale::PUMA_562)
        });
        assert_eq!(rounded(&all), rounded(&z.times(&y).times(&x)));
    }

    /// World: `pos = acc + set; ori = acc · set`. Tool: `T = set · acc`.
    #[test]
    fn increments_add_up_in_world_and_in_tool_coordinates() {
        let scale = Scale::PUMA_562;
        let shift = Pose::from_values([32, 0, 0, 0, 0, 0], &scale);
        let turn = Pose::from_values([0, 0, 0, 0, 0, QUARTER], &scale);
        let add = |frame, steps: [&Pose; 2]| {
            steps.iter().fold(Pose::IDENTITY, |sum: Pose, step| sum.accumulated(step, frame))
        };
        let attitude = [[0, 1000, 0], [-1000, 0, 0], [0, 0, 1000]];
        let with = |p: [i64; 3]| [attitude[0], attitude[1], attitude[2], p];
        // In world coordinates a turn leaves the position alone, whichever comes first.
        assert_eq!(rounded(&add(CoordinateFrame::World, [&shift, &turn])), with([1000, 0, 0]));
        assert_eq!(rounded(&add(CoordinateFrame::World, [&turn, &shift])), with([1000, 0, 0]));
        // In tool coordinates `set` comes first: a turn also turns the accumulated correction.
        assert_eq!(rounded(&add(CoordinateFrame::Tool, [&shift, &turn])), with([0, 1000, 0]));
        assert_eq!(rounded(&add(CoordinateFrame::Tool, [&turn, &shift])), with([1000, 0, 0]));

        // The path's place with a correction: along the world's axes, or along the tool's.
        let path = Pose { p: [10.0, 20.0, 30.0], ..turn };
        assert_eq!(rounded(&path.corrected(&shift, CoordinateFrame::World))[3], [11_000, 20_000, 30_000]);
        assert_eq!(rounded(&path.corrected(&shift, CoordinateFrame::Tool))[3], [10_000, 21_000, 30_000]);
    }

    #[test]
    fn an_attitude_stays_orthonormal_over_many_cycles() {
        let mut sum = Pose::IDENTITY;
        let mut random = fastrand::Rng::with_seed(2);
        for _ in 0..20_000 {
            let set = Pose::from_values(core::array::from_fn(|_| random.i16(-150..=150)), &Scale::PUMA_562);
            sum = sum.accumulated(&set, CoordinateFrame::Tool);
        }
        assert!(sum.orthonormality() < 1e-14, "{}", sum.orthonormality());
    }

    #[test]
    fn an_attitude_that_is_no_rotation_is_seen_and_put_right() {
        let long = Pose { n: [2.0, 0.0, 0.0], a: [0.0, 0.0, 2.0], ..Pose::IDENTITY };
        assert_eq!(long.orthonormality(), 1.0);
        let askew = Pose { n: [2.0, 0.0, 0.0], o: [0.5, 4.0, 0.0], ..Pose::IDENTITY };
        for frame in [CoordinateFrame::World, CoordinateFrame::Tool] {
            assert_eq!(askew.accumulated(&Pose::IDENTITY, frame), Pose::IDENTITY);
        }
    }

    #[test]
    fn each_layout_has_its_words_in_its_order() {
        let pose = Pose { n: [1.0, 2.0, 3.0], o: [4.0, 5.0, 6.0], a: [7.0, 8.0, 9.0], p: [10.0, 11.0, 12.0] };
        for (order, words) in [
            (Order::Columns, [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12]),
            (Order::Rows, [1, 4, 7, 10, 2, 5, 8, 11, 3, 6, 9, 12]),
            (Order::PositionThenColumns, [10, 11, 12, 1, 2, 3, 4, 5, 6, 7, 8, 9]),
            (Order::RotationRowsThenPosition, [1, 4, 7, 2, 5, 8, 3, 6, 9, 10, 11, 12]),
        ] {
            let layout = Layout { order, rotation_one: 1.0, per_mm: 1.0 };
            assert_eq!(layout.words(&pose), Transform(words), "{order:?}");
            assert_eq!(layout.pose(&Transform(words)), pose, "{order:?}");
        }
    }

    #[test]
    fn a_transformation_is_read_by_its_layout() {
        let words = Transform([16384, 0, 0, 0, -16384, 0, 0, 0, -16384, 12800, -4816, 16]);
        let pose = Layout::default().pose(&words);
        let expected =
            Pose { n: [1.0, 0.0, 0.0], o: [0.0, -1.0, 0.0], a: [0.0, 0.0, -1.0], p: [400.0, -150.5, 0.5] };
        assert_eq!(pose, expected);
        assert_eq!(pose.orthonormality(), 0.0);

        let turned = Pose {
            p: [400.0, -150.5, 0.5],
            ..Pose::from_values([0, 0, 0, 500, -900, 7000], &Scale::PUMA_562)
        };
        for (name, layout) in Layout::NAMED {
            let words = layout.words(&turned);
            let back = layout.pose(&words);
            assert!(back.orthonormality() < 2e-4, "{name}: {}", back.orthonormality());
            assert_eq!(back.p, turned.p);
            // A layout that puts the position elsewhere shows; the transpose of a rotation does not.
            for (other_name, other) in Layout::NAMED {
                let place = |layout: &Layout| match layout.order {
                    Order::Columns | Order::RotationRowsThenPosition => 0,
                    order => 1 + usize::from(order == Order::Rows),
                };
                let fits = other.pose(&words).orthonormality() < 2e-4;
                assert_eq!(fits, place(&layout) == place(&other), "{name} read as {other_name}");
            }
        }
        let far = Pose { p: [1024.0, 0.0, -2000.0], ..Pose::IDENTITY };
        assert_eq!(Layout::COLUMNS.words(&far).0[9..], [32767, 0, -32768]);
        let mirrored = Pose { a: [0.0, 0.0, -1.0], ..Pose::IDENTITY };
        assert_eq!(mirrored.orthonormality(), 2.0);
    }

    #[test]
    fn each_increment_moves_the_arm_and_an_offset_holds_it_off_the_path() {
        let at = |mode, values: &[i16]| {
            let mut arm = Arm::new(ArmConfig::default(), mode);
            arm.begin();
            values.iter().for_each(|x| arm.take([*x, 0, 0, 0, 0, 0]));
            (arm.pose().p[0], arm.transform().0[9])
        };
        assert_eq!(at(Mode::CUMULATIVE_23, &[80, 80]), (405.0, 405 * 32));
        assert_eq!(at(Mode::NON_CUMULATIVE_22, &[160, 80]), (402.5, 12880));
        // The path of the next ALTER begins at the position in which the previous one has left the arm.
        let mut arm = Arm::new(ArmConfig::default(), Mode::NON_CUMULATIVE_22);
        for x in [405.0, 410.0] {
            arm.begin();
            arm.take([160, 0, 0, 0, 0, 0]);
            assert_eq!(arm.pose().p[0], x);
        }
    }
}
