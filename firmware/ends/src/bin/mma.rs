//! The robot of an MM&A cell: orders go into a queue in the interrupt of the session, and the main loop moves the axes.
#![no_std]
#![no_main]

use core::ops::ControlFlow;
use core::time::Duration;

use board::{Driver, Link, Uart};
use mmacell_proto::{Device, DeviceConfig, DeviceEvent, ErrorCode, Order, RobotPose};
use robot_session::Session as _;
use robot_work_queue::{NoWake, Reader, WorkQueue, Writer};
use static_cell::{ConstStaticCell, StaticCell};

type Session = Device<RobotPose>;
static ORDERS: ConstStaticCell<WorkQueue<Order<RobotPose>, 4>> =
    ConstStaticCell::new(WorkQueue::numbered::<9999>());
static REPORTS: ConstStaticCell<WorkQueue<Report, 8>> = ConstStaticCell::new(WorkQueue::numbered::<9999>());
static LINK: StaticCell<Mma> = StaticCell::new();

const HOME: RobotPose = RobotPose::from_units([0, 0, 100_000, 0]);
/// The motion of the axes per millisecond at 100 %: 250 mm/s and 3 rad/s.
const SPEEDS: [i32; 4] = [250, 250, 250, 30];

/// A report of the motion task to the session.
enum Report {
    Pose(RobotPose),
    Arrived,
}

/// The link of the session's interrupt.
struct Mma {
    driver: Driver<64, { Session::MAX_TRANSMIT }>,
    session: Session,
    orders: Writer<'static, Order<RobotPose>>,
    reports: Reader<'static, Report>,
}

impl Link for Mma {
    fn poll(&mut self) -> Option<Duration> {
        while let Some(report) = self.reports.take() {
            match report.complete() {
                Report::Pose(pose) => self.session.set_pose(pose),
                Report::Arrived => self.session.arrived(),
            }
        }
        let orders = &mut self.orders;
        let Ok(turn) = self.driver.poll(&mut self.session, |session, event| {
            handle(session, event, orders);
            ControlFlow::<()>::Continue(())
        });
        turn.continue_value().flatten()
    }
}

fn handle(
    session: &mut Session,
    event: DeviceEvent<RobotPose>,
    orders: &mut Writer<'static, Order<RobotPose>>,
) {
    defmt::debug!("{}", event);
    match event {
        DeviceEvent::Asked { order: order @ Order::Close } => _ = session.accept(order),
        DeviceEvent::Asked { order } => match orders.claim() {
            Ok(place) if !matches!(order, Order::Acquire { .. } | Order::Grip { .. }) => {
                if session.accept(order).is_ok() {
                    place.push(order);
                }
            }
            _ => _ = session.refuse(order, ErrorCode::Generic),
        },
        // The line stays: whoever comes next speaks on it.
        DeviceEvent::Closed { .. } => {
            session.handle_disconnected(board::now());
            session.handle_connected(board::now());
        }
        _ => {}
    }
}

/// The axes, and where they go.
struct Axes {
    at: [i32; 4],
    to: Option<[i32; 4]>,
    percent: i32,
}

impl Axes {
    /// Moves the axes for one millisecond; returns true when they have arrived.
    fn step(&mut self) -> bool {
        let Some(to) = self.to else { return false };
        for ((at, to), speed) in self.at.iter_mut().zip(to).zip(SPEEDS) {
            let most = speed * self.percent / 100;
            *at += (to - *at).clamp(-most, most);
        }
        self.at == to
    }

    fn obey(&mut self, order: Order<RobotPose>) {
        match order {
            Order::Override { percent } => self.percent = i32::from(percent),
            Order::Move { target } => self.to = Some(target.units()),
            Order::Home => self.to = Some(HOME.units()),
            Order::Stop | Order::Servo { on: false } => self.to = self.to.map(|_| self.at),
            _ => {}
        }
    }
}

#[inline(never)] // its temporaries use its stack, which is free again for the motion
fn start(uart: Uart, orders: Writer<'static, Order<RobotPose>>, reports: Reader<'static, Report>) {
    let link = LINK.init_with(|| {
        let Ok(session) = Device::new(DeviceConfig::DEFAULT) else { panic!("it works") };
        Mma { driver: Driver::new(uart, board::now), session, orders, reports }
    });
    link.session.set_pose(HOME);
    link.session.handle_connected(board::now());
    board::start(link);
}

#[board::entry]
fn main() -> ! {
    let uart = board::init(115_200);
    let (writer, mut orders) = ORDERS.take().split_with(NoWake, NoWake);
    let (mut tell, reports) = REPORTS.take().split_with(board::wake, NoWake);
    start(uart, writer, reports);
    board::enable_drives();
    defmt::info!("mma");
    let mut axes = Axes { at: HOME.units(), to: None, percent: 100 };
    let (mut executed, mut arrived) = (0_u32, 0_u32);
    loop {
        if let Some(order) = orders.take() {
            executed += 1;
            defmt::info!("order {}: {}", executed, *order);
            axes.obey(order.complete());
        }
        if axes.to.is_none() {
            board::idle(|| !orders.is_empty());
            continue;
        }
        board::pause(Duration::from_millis(1));
        let is_there = axes.step();
        // A pose that has no place is followed by another; the last one and the arrival wait for theirs.
        while tell.free() < if is_there { 2 } else { 0 } {
            board::is_alive();
        }
        if let Ok(place) = tell.claim() {
            place.push(Report::Pose(RobotPose::from_units(axes.at)));
        }
        if is_there && let Ok(place) = tell.claim() {
            axes.to = None;
            place.push(Report::Arrived);
            arrived += 1;
            defmt::info!("arrived {}: {}", arrived, axes.at);
        }
    }
}
