//! One program a crate: it handles a few frames, and its status is 0 only if the result is right.

// The telemetry block through both ends, and an RTU frame through its decoder.
program!("fanuc-hmi-modbus", {
    use core::time::Duration;
    use fanuc_hmi_modbus::robot_session::{Decoder as _, Session as _};
    use fanuc_hmi_modbus::{
        Client, ClientConfig, ClientEvent, Decoder, Exception, Framing, Registers, Reply, Server,
        ServerConfig, Side, Signal, Table, TelemetryBlock, WordOrder, WordsMut,
    };

    struct Robot;

    impl Registers for Robot {
        fn read_holding_registers(&mut self, _: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
            let block = TelemetryBlock { life_counter: 100_000, ..TelemetryBlock::default() };
            out.copy_from(&block.to_registers(WordOrder::LowFirst));
            Ok(())
        }
    }

    fn exchange() -> Option<u32> {
        let mut client = Client::<1>::new(ClientConfig::tcp()).ok()?;
        let mut server = Server::<_, 1>::new(ServerConfig::tcp(), Robot).ok()?;
        let (now, mut buf) = (Duration::ZERO, [0; 260]);
        client.handle_connected(now);
        server.handle_connected(now);
        client.request(1, &TelemetryBlock::request()).ok()?;
        let n = client.poll_transmit(now, &mut buf)?;
        server.handle_input(now, buf.get(..n)?);
        let n = server.poll_transmit(now, &mut buf)?;
        client.handle_input(now, buf.get(..n)?);
        let ClientEvent::Replied { ticket, .. } = client.poll_event()? else { return None };
        match client.reply(ticket)? {
            Reply::HoldingRegisters(words) => {
                Some(TelemetryBlock::from_words(&words, WordOrder::LowFirst)?.life_counter)
            }
            _ => None,
        }
    }

    fn rtu() -> Option<u8> {
        let mut decoder = Decoder::new(Framing::RTU_OVER_TCP, Side::Client);
        let bytes = [0x55, 1, 3, 0, 0, 0, 37, 0x84, 0x11];
        if decoder.push(&bytes) != bytes.len() {
            return None;
        }
        decoder.finish();
        decoder.next_frame()?.err()?;
        Some(decoder.next_frame()?.ok()?.unit)
    }

    fn signal() -> Option<Signal> {
        let (table, address) = Signal::Ri(3).place()?;
        Signal::at(table, address).filter(|_| table == Table::DiscreteInputs)
    }

    i32::from(exchange() != Some(100_000) || rtu() != Some(1) || signal() != Some(Signal::Ri(3)))
});

// A program through the reader and the writer. It holds texts, so it needs an allocator: the C library's, and no std.
program!("fanuc-ls", {
    use core::alloc::{GlobalAlloc, Layout};
    use core::ffi::c_void;
    use fanuc_ls::{Program, Rules};

    struct Malloc;

    unsafe extern "C" {
        fn aligned_alloc(align: usize, size: usize) -> *mut c_void;
        fn free(block: *mut c_void);
    }

    // SAFETY: `aligned_alloc` gives blocks of this size (rounded up to the alignment, as C wants it) and alignment, or null;
    // `free` takes them back.
    unsafe impl GlobalAlloc for Malloc {
        unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
            let align = layout.align().max(size_of::<*mut c_void>());
            // SAFETY: the alignment is a power of two and the size a multiple of it.
            unsafe { aligned_alloc(align, layout.size().next_multiple_of(align)) }.cast()
        }

        unsafe fn dealloc(&self, block: *mut u8, _: Layout) {
            // SAFETY: the block is one of `alloc`'s.
            unsafe { free(block.cast()) }
        }
    }

    #[global_allocator]
    static MALLOC: Malloc = Malloc;

    /// Stands for the unwinder: the `alloc` that comes compiled with the toolchain refers to these two functions, which only
    /// std provides, although no code unwinds here.
    #[unsafe(no_mangle)]
    extern "C" fn rust_eh_personality() {}

    #[unsafe(no_mangle)]
    extern "C" fn _Unwind_Resume() {}

    fn run() -> Option<bool> {
        let text = "/PROG  A\r\n/MN\r\n   1:J P[1] 2% FINE    ;\r\n/POS\r\nP[1]{\r\n   GP1:\r\n\tUF : 0, UT : 1,\t\r\n\tJ1=      .500 deg\r\n};\r\n/END\r\n";
        Some(Program::decode(text).ok()?.to_text(&Rules::default()).ok()? == text)
    }

    i32::from(run() != Some(true))
});

// Two polls and their packets through both ends.
program!("isra-ball", {
    use core::time::Duration;
    use isra_ball::robot_session::Session as _;
    use isra_ball::{Ball, BallConfig, Host, HostConfig, HostEvent, Keys};

    fn run() -> Option<[i8; 6]> {
        let mut host = Host::new(HostConfig::default()).ok()?;
        let mut ball = Ball::new(BallConfig::default()).ok()?;
        let mut buf = [0; 16];
        host.handle_connected(Duration::ZERO);
        ball.handle_connected(Duration::ZERO);
        loop {
            ball.measure([1, -2, 3], [-4, 5, -6], Keys(0x81));
            let now = host.poll_timeout()?;
            let n = host.poll_transmit(now, &mut buf)?;
            ball.handle_input(now, buf.get(..n)?);
            let n = ball.poll_transmit(now, &mut buf)?;
            host.handle_input(now + Duration::from_millis(14), buf.get(..n)?);
            match host.poll_event()? {
                HostEvent::Packet(packet) => return Some(packet.axes()),
                // The age of the first packet is unknown.
                HostEvent::Old(_) => {}
                _ => return None,
            }
        }
    }

    i32::from(run() != Some([1, -2, 3, -4, 5, -6]))
});

// An order of three jobs through both ends and the queue.
program!("kawasaki-msg", {
    use core::time::Duration;
    use kawasaki_msg::robot_session::Session as _;
    use kawasaki_msg::motion::JobQueue;
    use kawasaki_msg::{JobKind, Line, Pc, PcConfig, Point, Robot, RobotConfig};

    /// Returns the position of the pen at the end, and the number of jobs that the PC knows to be executed.
    fn run() -> Option<(i32, u32)> {
        let mut queue: JobQueue<Line, 2> = JobQueue::new(9).ok()?;
        let (jobs, mut motion) = queue.split();
        let mut robot = Robot::new(RobotConfig { max_number: 9, ..RobotConfig::tcp() }, jobs).ok()?;
        let mut pc = Pc::new(PcConfig { max_number: 9, ..PcConfig::tcp() }).ok()?;
        let line = |x| Line { kind: JobKind::Draw, start: Point::new(x, 0), end: Point::new(x + 100, 0) };
        let picture = [line(0), line(100), line(200)];
        pc.start(50, &picture[..]).ok()?;
        let (mut pen, mut buffer) = (0, [0; 4096]);
        robot.handle_timeout(Duration::ZERO);
        robot.handle_connected(Duration::ZERO);
        pc.handle_connected(Duration::ZERO);
        for i in 1..1000 {
            let now = Duration::from_millis(16 * i);
            while let Some(job) = motion.take() {
                pen = job.complete().work.end.x;
            }
            robot.handle_timeout(now);
            if let Some(length) = robot.poll_transmit(now, &mut buffer) {
                pc.handle_input(now, buffer.get(..length)?);
            }
            if let Some(length) = pc.poll_transmit(now + Duration::from_millis(2), &mut buffer) {
                robot.handle_input(now, buffer.get(..length)?);
            }
            if pc.order().is_none() {
                return Some((pen, pc.executed()));
            }
        }
        None
    }

    i32::from(run() != Some((300, 3)))
});

// A batch and its answer through both ends, and the queue between them.
program!("laser-eb90", {
    use core::time::Duration;
    use laser_eb90::robot_session::Session as _;
    use laser_eb90::{Controller, ControllerConfig, Frame, Host, HostConfig, HostEvent, Instruction, Item};
    use robot_work_queue::WorkQueue;

    struct Cut([f32; 2]);

    impl TryFrom<Instruction<'_>> for Cut {
        type Error = ();

        fn try_from(mut instruction: Instruction<'_>) -> Result<Self, ()> {
            match instruction.parameters.next() {
                Some(Ok(Item::F32(values))) => values.array().map(Self).ok_or(()),
                _ => Err(()),
            }
        }
    }

    fn run() -> Option<[f32; 2]> {
        let mut queue = WorkQueue::<Cut, 7>::new(9999).ok()?;
        let (writer, mut reader) = queue.split();
        let mut controller = Controller::new(ControllerConfig::default(), writer).ok()?;
        let mut host = Host::new(HostConfig::default()).ok()?;
        controller.handle_connected(Duration::ZERO);
        host.handle_connected(Duration::ZERO);
        let mut line = [0; Frame::MAX_LEN];
        for x in [4.0, 5.0, 6.0] {
            host.submit(0x0101, |parameters| parameters.f32(&[x, 18.0]).map(drop)).ok()?;
        }
        let start = host.poll_timeout()?;
        let n = host.poll_transmit(start, &mut line)?;
        controller.handle_input(start, line.get(..n)?);
        let end = controller.poll_timeout()?;
        let n = controller.poll_transmit(end, &mut line)?;
        host.handle_input(end, line.get(..n)?);
        match host.poll_event()? {
            HostEvent::Done { count: 3, .. } => reader.take().map(|job| job.0),
            _ => None,
        }
    }

    i32::from(run() != Some([4.0, 18.0]))
});

// A question and its answer through both ends.
program!("mmacell-proto", {
    use core::time::Duration;
    use mmacell_proto::robot_session::Session as _;
    use mmacell_proto::{Central, CentralConfig, CentralEvent, Command, Device, DeviceConfig, RobotPose};

    fn run() -> Option<[i32; 4]> {
        let mut robot = Device::new(DeviceConfig::DEFAULT).ok()?;
        robot.set_pose(RobotPose::from_units([10_000, -2_000, 5_999, -12_322]));
        let mut central = Central::<RobotPose>::new(CentralConfig::DEFAULT).ok()?;
        let (now, mut buf) = (Duration::ZERO, [0; 64]);
        robot.handle_connected(now);
        central.handle_connected(now);
        central.poll_event()?;
        central.request(Command::Status).ok()?;
        let n = central.poll_transmit(now, &mut buf)?;
        robot.handle_input(now, buf.get(..n)?);
        let n = robot.poll_transmit(now, &mut buf)?;
        central.handle_input(now, buf.get(..n)?);
        match central.poll_event()? {
            CentralEvent::Status { status, .. } => Some(status.pose.units()),
            _ => None,
        }
    }

    i32::from(run() != Some([10_000, -2_000, 5_999, -12_322]))
});

// The task until its first order to the robot.
program!("mmacell-task", {
    use core::time::Duration;
    use mmacell_task::mmacell_proto::Command;
    use mmacell_task::{Device, Event, Output, Step, Task, TaskConfig};

    fn run() -> Option<Command<mmacell_task::mmacell_proto::RobotPose>> {
        let (now, mut task) = (Duration::ZERO, Task::new(TaskConfig::DEFAULT));
        for device in [Device::Robot, Device::Platform, Device::Conditioning] {
            task.handle_event(now, Event::Ready(device));
        }
        while let Some(output) = task.poll_output(now) {
            if let (Output::Robot(command), Step::ServosOn) = (output, task.step()) {
                return Some(command);
            }
        }
        None
    }

    i32::from(run() != Some(Command::Servo { on: true }))
});

// Jobs through both ends, one of them out of order, and a reset.
program!("robot-work-queue", {
    use robot_work_queue::WorkQueue;

    fn run() -> Option<[u32; 3]> {
        let mut queue: WorkQueue<u32, 3> = WorkQueue::new(9).ok()?;
        let (mut writer, mut reader) = queue.split();
        for number in 1..=3 {
            writer.claim().ok()?.commit(number, number.into()).ok()?;
        }
        let first = reader.take_where(|_, job| *job == 2)?.complete();
        let second = reader.take()?.complete();
        writer.clear();
        writer.claim().ok()?.commit(4, 4).ok()?;
        let third = reader.take()?.complete();
        (writer.is_settled() && reader.take().is_none()).then_some([first, second, third])
    }

    i32::from(run() != Some([2, 1, 4]))
});

// A start, a standard message and its reply through both ends.
program!("val2-alter", {
    use core::time::Duration;
    use val2_alter::robot_session::Session as _;
    use val2_alter::{Controller, ControllerConfig, Frame, Host, HostConfig, Limits, timing};

    fn run() -> Option<i16> {
        let mut controller = Controller::new(ControllerConfig::default()).ok()?;
        let mut host = Host::new(HostConfig { limits: Limits::NONE, ..HostConfig::default() }).ok()?;
        controller.handle_connected(Duration::ZERO);
        host.handle_connected(Duration::ZERO);
        let mut buf = [0; Frame::MAX_LEN];
        controller.start(Duration::ZERO).ok()?;
        for now in [Duration::ZERO, timing::CYCLE] {
            let n = controller.poll_transmit(now, &mut buf)?;
            host.handle_input(now, buf.get(..n)?);
            let n = host.poll_transmit(now, &mut buf)?;
            // Bytes that arrive while the request is still on the line are not a reply to it.
            controller.handle_input(now + timing::CYCLE / 2, buf.get(..n)?);
            host.set_target(now, [80, 0, 0, 0, 0, 0]);
        }
        controller.values().first().copied()
    }

    i32::from(run() != Some(80))
});

// A request and its pose through both ends.
program!("val2-viewer", {
    use core::time::Duration;
    use val2_viewer::robot_session::Session as _;
    use val2_viewer::{Host, HostConfig, Workstation, WorkstationConfig, WorkstationEvent};

    const POSE: [i16; 12] = [16384, 0, 0, 0, -16384, 0, 0, 0, -16384, 12800, -4816, 16];

    fn run() -> Option<[i16; 12]> {
        let mut host = Host::new(HostConfig::default()).ok()?;
        let mut workstation = Workstation::new(WorkstationConfig::default()).ok()?;
        let mut buf = [0; Host::MAX_TRANSMIT];
        host.handle_connected(Duration::ZERO);
        workstation.handle_connected(Duration::ZERO);
        let now = Duration::from_millis(200);
        workstation.draw(now);
        let n = workstation.poll_transmit(now, &mut buf)?;
        host.set_pose(now, POSE);
        host.handle_input(now, buf.get(..n)?);
        let n = host.poll_transmit(now, &mut buf)?;
        workstation.handle_input(now, buf.get(..n)?);
        match workstation.poll_event()? {
            WorkstationEvent::Pose(packet) => Some(packet.pose),
            _ => None,
        }
    }

    i32::from(run() != Some(POSE))
});
