//! Orders with the robot in Rust and with the AS program, which do the same: start, refusal, takeover, end, interruption, the two
//! resets, and restarts of an end.
#![allow(clippy::cast_possible_truncation)]

mod rig;

use core::time::Duration;

use kawasaki_msg::robot_session::Session as _;
use kawasaki_msg::{PcConfig, PcEvent, Phase, RobotConfig, RobotEvent, SessionError, Takeover};
use rig::{MS, Rig, expected, picture, sent};
use testkit::controller::{AsRobot, Controller, Native};

const LIMIT: Duration = Duration::from_secs(100);

/// Stories with the session in Rust, and with the AS program.
macro_rules! both {
    ($($story:ident,)*) => {
        mod native {
            $(#[test]
            fn $story() {
                super::$story::<super::Native>();
            })*
        }
        mod as_program {
            $(#[test]
            fn $story() {
                super::$story::<super::AsRobot>();
            })*
        }
    };
}

both! {
    start_and_end_are_acknowledged,
    an_order_without_jobs_begins_and_ends,
    one_order_at_a_time,
    an_interrupted_order_ends_after_the_job_that_is_being_executed,
    an_order_ended_early_executes_what_is_queued,
    another_order_is_interrupted_before_ours_begins,
    another_order_can_be_let_end_by_itself,
    another_order_is_left_alone_where_that_is_wished,
    another_order_of_the_same_number_is_not_taken_for_ours,
    so_it_is_on_a_connection_that_is_not_new_to_the_robot,
    a_restarted_robot_leaves_the_outcome_unknown,
    an_order_that_ended_while_nobody_was_connected_is_not_unknown,
    an_order_that_the_pc_does_not_know_can_end_by_itself,
    an_order_waits_for_a_robot,
    the_first_reset_clears_the_list_and_what_was_in_it_comes_again,
    the_second_reset_forgets_the_order,
}

/// Creates both ends with the defaults.
fn rig<C: Controller>(capacity: usize) -> Rig<C> {
    Rig::new(RobotConfig::tcp(), PcConfig::tcp(), capacity)
}

/// Returns a rig whose robot is in the middle of an order of 1000 jobs.
fn in_the_middle<C: Controller>(pc: PcConfig, robot: RobotConfig) -> Rig<C> {
    let mut rig = Rig::new(robot, pc, 64);
    rig.pc.start(50, picture(50, 1000)).unwrap();
    rig.run_until(LIMIT, |rig| rig.executed.len() == 100);
    rig
}

fn start_and_end_are_acknowledged<C: Controller>() {
    let mut rig = rig::<C>(64);
    rig.pc.start(50, picture(50, 3)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(sent(&rig.from_pc, "TilausAlkaa"), ["<TilausAlkaa$4#50$1#>"]);
    assert_eq!(sent(&rig.from_robot, "TilausKuittaus"), ["<TilausKuittaus$2#50#>"]);
    assert_eq!(sent(&rig.from_robot, "LoppuKuittaus"), ["<LoppuKuittaus$6#50$0$3#>"]);
    assert_eq!((rig.pc.phase(), rig.robot.phase()), (Phase::Idle, Phase::Idle));
    assert_eq!((rig.pc.order(), rig.robot.order()), (None, None));
}

fn an_order_without_jobs_begins_and_ends<C: Controller>() {
    let (robot, pc) =
        (RobotConfig { max_number: 2, ..RobotConfig::tcp() }, PcConfig { max_number: 2, ..PcConfig::tcp() });
    let mut rig = Rig::<C>::new(robot, pc, 1);
    rig.pc.start(1, picture(1, 0)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    assert!(rig.pc_events.contains(&PcEvent::OrderOver { order: 1, executed: 0, complete: true }));
}

fn one_order_at_a_time<C: Controller>() {
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), RobotConfig::tcp());
    assert_eq!(rig.pc.start(51, picture(51, 1)), Err(SessionError::OrderActive { active: 50 }));
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(rig.pc.start(0, picture(0, 1)), Err(SessionError::OrderZero));
    rig.pc_events.clear();
    rig.pc.start(51, picture(51, 20)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(rig.lines(), [expected(50, 1000), expected(51, 20)].concat());
}

fn an_interrupted_order_ends_after_the_job_that_is_being_executed<C: Controller>() {
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), RobotConfig::tcp());
    rig.pc.interrupt().unwrap();
    let before = rig.executed.len();
    rig.run_until(LIMIT, Rig::is_over);
    let executed = rig.executed.len() as u32;
    assert!(executed < before as u32 + 64, "the queue was cleared: {executed}");
    let over = PcEvent::OrderOver { order: 50, executed, complete: false };
    assert!(rig.pc_events.contains(&over), "{:?}", rig.pc_events);
    assert!(rig.robot_events.contains(&RobotEvent::OrderOver { order: 50, executed }));
    assert_eq!(rig.lines(), expected(50, executed));
    // "After the interruption the drawing cannot go on" (thesis, section 11.1): the same picture starts again.
    rig.pc_events.clear();
    rig.pc.start(50, picture(50, 10)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(rig.lines()[executed as usize..], expected(50, 10));
    assert_eq!(rig.pc.interrupt(), Err(SessionError::NoOrder));
}

fn an_order_ended_early_executes_what_is_queued<C: Controller>() {
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), RobotConfig::tcp());
    rig.pc.end().unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    let executed = rig.executed.len() as u32;
    assert!((100..1000).contains(&executed));
    assert_eq!(rig.robot.queued(), executed);
    assert!(rig.pc_events.contains(&PcEvent::OrderOver { order: 50, executed, complete: false }));
}

/// Restarts the PC program: it has no record of the robot's order.
fn restart_pc<C>(rig: &mut Rig<C>, pc: PcConfig) {
    rig.link.disconnect(rig.now);
    rig.pc = kawasaki_msg::LargePc::with_ranges(pc, Default::default()).unwrap();
    rig.pc_events.clear();
}

fn another_order_is_interrupted_before_ours_begins<C: Controller>() {
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), RobotConfig::tcp());
    restart_pc(&mut rig, PcConfig::tcp());
    rig.pc.start(51, picture(51, 10)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    let refused = PcEvent::OrderRefused { order: 51, active: 50, given_up: false };
    let place = |event: &PcEvent| rig.pc_events.iter().position(|e| e == event);
    assert!(place(&refused) < place(&PcEvent::OrderStarted { order: 51 }), "{:?}", rig.pc_events);
    assert!(place(&refused).is_some());
    assert!(rig.robot_events.contains(&RobotEvent::OrderRefused { order: 51, active: 50 }));
    let first = rig.executed.len() - 10;
    assert_eq!(rig.lines()[first..], expected(51, 10));
    assert_eq!(rig.lines()[..first], expected(50, first as u32));
    assert!(!sent(&rig.from_pc, "TilausKeskeytyy").is_empty());
}

fn another_order_can_be_let_end_by_itself<C: Controller>() {
    let pc = PcConfig { takeover: Takeover::End, ..PcConfig::tcp() };
    let mut rig = in_the_middle::<C>(pc, RobotConfig::tcp());
    let queued = rig.robot.queued();
    restart_pc(&mut rig, pc);
    rig.pc.start(51, picture(51, 10)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    let first = rig.executed.len() - 10;
    assert!(first >= queued as usize, "what was queued is executed");
    assert_eq!(rig.lines()[..first], expected(50, first as u32));
    assert!(sent(&rig.from_pc, "TilausKeskeytyy").is_empty());
}

fn another_order_is_left_alone_where_that_is_wished<C: Controller>() {
    let pc = PcConfig { takeover: Takeover::Never, ..PcConfig::tcp() };
    let mut rig = in_the_middle::<C>(pc, RobotConfig::tcp());
    restart_pc(&mut rig, pc);
    rig.pc.start(51, picture(51, 10)).unwrap();
    rig.run_for(Duration::from_secs(10));
    assert!(rig.pc_events.contains(&PcEvent::OrderRefused { order: 51, active: 50, given_up: true }));
    assert_eq!((rig.pc.phase(), rig.robot.order()), (Phase::Idle, Some(50)));
}

fn another_order_of_the_same_number_is_not_taken_for_ours<C: Controller>() {
    // The restarted PC begins order 50 again while the robot is in the middle of the old one: "50" is not an acceptance.
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), RobotConfig::tcp());
    restart_pc(&mut rig, PcConfig::tcp());
    rig.pc.start(50, picture(50, 500)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    let first = rig.executed.len() - 500;
    assert_eq!(rig.lines()[first..], expected(50, 500), "from its first job on");
    assert_eq!(rig.lines()[..first], expected(50, first as u32));
}

/// A PC without a record of the order, on the connection of the previous PC, sends no start before the robot's
/// status.
fn so_it_is_on_a_connection_that_is_not_new_to_the_robot<C: Controller>() {
    for refuse_repeated_start in [false, true] {
        let robot = RobotConfig { refuse_repeated_start, ..RobotConfig::tcp() };
        let mut rig = in_the_middle::<C>(PcConfig::tcp(), robot);
        rig.pc = kawasaki_msg::LargePc::with_ranges(PcConfig::tcp(), Default::default()).unwrap();
        (rig.from_pc, rig.from_robot) = (Vec::new(), Vec::new());
        rig.pc_events.clear();
        rig.pc.handle_connected(rig.now);
        rig.pc.start(50, picture(50, 500)).unwrap();
        rig.run_until(LIMIT, Rig::is_over);
        let first = rig.executed.len() - 500;
        assert_eq!(rig.lines()[first..], expected(50, 500), "from its first job on");
        assert_eq!(rig.lines()[..first], expected(50, first as u32));
        let refused = PcEvent::OrderRefused { order: 50, active: 50, given_up: false };
        assert!(rig.pc_events.contains(&refused), "{:?}", rig.pc_events);
        assert_eq!(sent(&rig.from_pc, "TilausAlkaa").len(), 1);
        assert_eq!(sent(&rig.from_robot, "TilausKuittaus"), ["<TilausKuittaus$2#50#>"]);
    }
}

fn a_restarted_robot_leaves_the_outcome_unknown<C: Controller>() {
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), RobotConfig::tcp());
    rig::restart(&mut rig, 64);
    rig.run_until(LIMIT, Rig::is_over);
    let Some(&PcEvent::OutcomeUnknown { order: 50, executed, sent }) =
        rig.pc_events.iter().find(|e| matches!(e, PcEvent::OutcomeUnknown { .. }))
    else {
        panic!("{:?}", rig.pc_events)
    };
    assert!(executed as usize <= rig.executed.len() && rig.executed.len() <= sent as usize);
    assert!(executed < sent);
    assert_eq!((rig.pc.phase(), rig.pc.executed(), rig.pc.sent()), (Phase::Idle, executed, sent));
    // The caller decides: here the picture starts again.
    rig.pc_events.clear();
    rig.executed.clear();
    rig.pc.start(50, picture(50, 10)).unwrap();
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(rig.lines(), expected(50, 10));
}

fn an_order_that_ended_while_nobody_was_connected_is_not_unknown<C: Controller>() {
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), RobotConfig::tcp());
    rig.reachable = false;
    rig.link.disconnect(rig.now);
    rig.run_for(20 * MS);
    rig.robot.reset_order().unwrap();
    rig.run_for(Duration::from_secs(1));
    rig.reachable = true;
    rig.run_until(LIMIT, Rig::is_over);
    let executed = rig.executed.len() as u32;
    let over = PcEvent::OrderOver { order: 50, executed, complete: false };
    assert!(rig.pc_events.contains(&over), "{:?}", rig.pc_events);
}

fn the_first_reset_clears_the_list_and_what_was_in_it_comes_again<C: Controller>() {
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), RobotConfig::tcp());
    rig.motion = None;
    rig.run_for(200 * MS);
    assert!(rig.robot.queued() > rig.robot.executed());
    rig.robot.clear_queue().unwrap();
    rig.motion = Some(MS);
    rig.run_until(LIMIT, Rig::is_over);
    // The arm of the AS program was on its way along line 101, and it looks at its signals in its next pass.
    let first = |next| if C::WHOLE { next == 101 } else { next > 101 };
    let cleared = |event: &RobotEvent| matches!(event, RobotEvent::QueueCleared { next } if first(*next));
    assert!(rig.robot_events.iter().any(cleared), "{:?}", rig.robot_events);
    assert_eq!(rig.lines(), expected(50, 1000));
    assert_eq!(rig.robot.clear_queue(), Err(SessionError::NoOrder));
}

fn the_second_reset_forgets_the_order<C: Controller>() {
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), RobotConfig::tcp());
    rig.robot.reset_order().unwrap();
    if C::WHOLE {
        // The AS program looks at its signals in its next pass.
        assert_eq!(rig.robot.phase(), Phase::Interrupted);
        assert_eq!(rig.robot.reset_order(), Err(SessionError::NoOrder), "it is on its way");
    }
    rig.run_until(LIMIT, Rig::is_over);
    let executed = rig.executed.len() as u32;
    assert!(rig.pc_events.contains(&PcEvent::OrderOver { order: 50, executed, complete: false }));
    assert_eq!(rig.robot.order(), None);
}

fn an_order_that_the_pc_does_not_know_can_end_by_itself<C: Controller>() {
    let robot = RobotConfig { end_foreign_order: true, ..RobotConfig::tcp() };
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), robot);
    restart_pc(&mut rig, PcConfig::tcp());
    rig.run_for(Duration::from_secs(5));
    assert_eq!(rig.robot.order(), None, "the PC's status says 0");
    let mut rig = in_the_middle::<C>(PcConfig::tcp(), RobotConfig::tcp());
    restart_pc(&mut rig, PcConfig::tcp());
    rig.run_for(Duration::from_secs(5));
    assert_eq!(rig.robot.order(), Some(50), "not unless it is wished");
}

fn an_order_waits_for_a_robot<C: Controller>() {
    let mut rig = rig::<C>(64);
    rig.reachable = false;
    rig.pc.start(50, picture(50, 10)).unwrap();
    rig.run_for(Duration::from_secs(10));
    assert_eq!(rig.pc.phase(), Phase::Starting);
    let tries = rig.robot_events.iter().filter(|e| **e == RobotEvent::Connect).count();
    // The times of the AS program have 24 bits.
    assert!((10..=11).contains(&tries), "one a second: {tries}");
    rig.reachable = true;
    rig.run_until(LIMIT, Rig::is_over);
    assert_eq!(rig.lines(), expected(50, 10));
}
