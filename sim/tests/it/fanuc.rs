//! A FANUC controller that misbehaves, over TCP and on a virtual clock.

use core::time::Duration;

use cellwire_sim::fanuc::{
    Controller, FanucController, FanucEvent, Program, Tables, TelemetryFault, TelemetryFaults, Write, circle,
};
use cellwire_sim::{Bench, Device as _, Fanuc, Fault, Script, Settings as _, SimulatorReport};
use fanuc_hmi_modbus::robot_session::Session as _;
use fanuc_hmi_modbus::robot_session::tokio::{Reconnect, Tcp};
use fanuc_hmi_modbus::tokio::{Error, client};
use fanuc_hmi_modbus::typed::{Kind, Multiply, Number};
use fanuc_hmi_modbus::{
    Client, ClientConfig, ClientEvent, Exception, Failure, PositionRegister, Registers as _, Reply, Request,
    ServerEvent, Signal, Table, TelemetryBlock, WordOrder, Words, text,
};

const MS: Duration = Duration::from_millis(1);
const S: Duration = Duration::from_secs(1);

#[tokio::test]
async fn a_gateway_counts_on_no_answer() {
    let sim = Fanuc::default().listen("127.0.0.1:0").unwrap();
    let config = ClientConfig { timeout: 100 * MS, ..ClientConfig::tcp() };
    let (robot, task) = client(config, Tcp::new(sim.address().to_string())).unwrap();
    tokio::spawn(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).run());
    assert_eq!(robot.read_holding_registers(99..100).await.unwrap(), [100], "R[100]");
    sim.faults().drop_next();
    let lost = robot.write_register(200, 7).await;
    assert!(matches!(lost, Err(Error::Failed(_))), "{lost:?}");
    sim.faults().cut_next();
    assert!(robot.write_register(201, 8).await.is_err());
    robot.handle().connected().await.unwrap();
    assert_eq!(robot.read_holding_registers(200..202).await.unwrap(), [7, 8], "both were written");
    let written: Vec<Write> = sim.executed().into_iter().map(|done| done.work).collect();
    assert_eq!(written, [Write::Registers(200, vec![7]), Write::Registers(201, vec![8])]);
}

#[tokio::test]
async fn two_clients_see_the_same_registers() {
    let sim = Fanuc::default().listen("127.0.0.1:0").unwrap();
    let to = || {
        let (robot, task) = client(ClientConfig::tcp(), Tcp::new(sim.address().to_string())).unwrap();
        tokio::spawn(task.run());
        robot
    };
    let (one, other) = (to(), to());
    one.write_coils(3, &[true, false, true]).await.unwrap();
    assert_eq!(other.read_coils(3..6).await.unwrap(), [true, false, true]);
    other.write_register(300, 7).await.unwrap();
    let written: Vec<Write> = sim.executed().into_iter().map(|done| done.work).collect();
    assert_eq!(written, [Write::Coils(3, vec![true, false, true]), Write::Registers(300, vec![7])]);
}

#[tokio::test]
async fn a_position_register_is_written_and_read_whole() {
    let sim = Fanuc::default().listen("127.0.0.1:0").unwrap();
    let (robot, task) = client(ClientConfig::tcp(), Tcp::new(sim.address().to_string())).unwrap();
    tokio::spawn(task.run());
    let position = PositionRegister {
        joints: Some([0.0, 10.0, -20.0, 0.0, -90.0, 45.0, 0.0, 0.0, 0.0]),
        user_tool: 2,
        ..Default::default()
    };
    robot.write_position(400, &position, WordOrder::LowFirst).await.unwrap();
    assert_eq!(robot.read_position(400, WordOrder::LowFirst).await.unwrap(), position);
    assert_eq!(sim.executed().len(), 1, "one request");
    let beyond = robot.read_position(16_400, WordOrder::LowFirst).await;
    assert!(matches!(beyond, Err(Error::Exception(Exception::IllegalDataAddress))), "{beyond:?}");
}

#[tokio::test]
async fn numbers_and_texts_are_read_by_their_assignment() {
    let sim = Fanuc::default().listen("127.0.0.1:0").unwrap();
    let (robot, task) = client(ClientConfig::tcp(), Tcp::new(sim.address().to_string())).unwrap();
    tokio::spawn(task.run());
    let speed = Number { kind: Kind::Int32, multiply: Multiply::Scale(10.0), order: WordOrder::HighFirst };
    robot.write_registers(400, &speed.write(-12_345.6).unwrap()).await.unwrap();
    assert_eq!(robot.read_number(400, speed).await.unwrap(), -12_345.6);
    let mut registers = [0xFFFF; text::REGISTERS];
    text::write(b"PART 7", &mut registers).unwrap();
    robot.write_registers(410, &registers).await.unwrap();
    assert_eq!(robot.read_text(410..450).await.unwrap(), "PART 7");
    let beyond = robot.read_number(16_447, speed).await;
    assert!(matches!(beyond, Err(Error::Exception(Exception::IllegalDataAddress))), "{beyond:?}");
}

#[tokio::test]
async fn a_running_controller_is_called_from_the_test() {
    let sim = Fanuc::default().listen("127.0.0.1:0").unwrap();
    let (robot, task) = client(ClientConfig::tcp(), Tcp::new(sim.address().to_string())).unwrap();
    tokio::spawn(task.run());
    assert_eq!(robot.read_discrete_inputs(1..2).await.unwrap(), [false]);
    let is_set = sim.call(|fanuc| {
        let mut controller = fanuc.device().controller();
        controller.set_values(Table::DiscreteInputs, 1, &[1])
    });
    assert_eq!(is_set, Some(Some(())));
    assert_eq!(robot.read_discrete_inputs(1..2).await.unwrap(), [true]);
}

/// The simulator of the device, which accepts connections, may be the first to see the fault.
#[tokio::test]
async fn a_connection_is_closed_at_once_whichever_simulator_sees_that_first() {
    let sim = Fanuc::default().listen("127.0.0.1:0").unwrap();
    let (robot, task) = client(ClientConfig::tcp(), Tcp::new(sim.address().to_string())).unwrap();
    tokio::spawn(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).run());
    for closed in 1..=8 {
        // It may not know yet that the connection before was closed.
        while robot.read_holding_registers(300..301).await.is_err() {
            tokio::time::sleep(MS).await;
        }
        sim.faults().at_once(Fault::Close);
        let closes =
            || sim.told().iter().filter(|(_, told)| matches!(told, SimulatorReport::Close(_))).count();
        let begun = std::time::Instant::now();
        while closes() < closed {
            assert!(begun.elapsed() < 20 * S, "connection {closed} stays open");
            tokio::time::sleep(MS).await;
        }
    }
}

#[tokio::test]
async fn what_happens_to_the_controller_happens_on_all_its_connections() {
    let sim = Fanuc::default().listen("127.0.0.1:0").unwrap();
    let to = || {
        let (robot, task) = client(ClientConfig::tcp(), Tcp::new(sim.address().to_string())).unwrap();
        tokio::spawn(task.reconnect(Reconnect { first: 5 * MS, longest: 50 * MS }).run());
        robot
    };
    let (one, other) = (to(), to());
    one.write_register(300, 9).await.unwrap();
    assert_eq!(other.read_holding_registers(300..301).await.unwrap(), [9]);
    sim.faults().freeze(300 * MS);
    while sim.faults().happened().is_empty() {
        tokio::time::sleep(MS).await;
    }
    tokio::time::sleep(20 * MS).await; // each connection looks for it every 5 ms
    let begun = std::time::Instant::now();
    let (first, second) = tokio::join!(one.read_coils(0..1), other.read_coils(0..1));
    assert!(first.is_ok() && second.is_ok() && begun.elapsed() > 150 * MS, "{:?}", begun.elapsed());
    sim.faults().restart(50 * MS);
    tokio::time::sleep(20 * MS).await;
    for robot in [&one, &other] {
        while robot.read_coils(0..1).await.is_err() {}
        assert_eq!(robot.read_holding_registers(300..301).await.unwrap(), [9], "a battery keeps R[301]");
    }
    sim.faults().forget();
    while one.read_holding_registers(300..301).await.unwrap() != [301] {
        tokio::time::sleep(MS).await;
    }
    let ends =
        sim.told().iter().filter(|(_, told)| *told == SimulatorReport::Close("the power is gone")).count();
    assert_eq!(ends, 2);
}

/// 200 mm across at 100 mm/s: around in 2π s. It rises and falls in 4π s, and sways in its own time.
#[test]
fn the_tool_goes_around_a_circle() {
    use core::f64::consts::PI;
    let [half, quarter] = [0.5, 0.25].map(|part: f64| part * PI);
    let (a, b) = ((0.7 * half).sin(), (0.3 * half).cos());
    let (c, d) = ((1.4 * PI).sin(), (0.6 * PI).cos());
    let around = [
        (0.0, [600.0, 0.0, 300.0], [180.0, 0.0, 65.0]),
        (half, [500.0, 100.0, 300.0 + 20.0 * quarter.sin()], [180.0 - 10.0 * a, 5.0, 45.0 + 20.0 * b]),
        (2.0 * PI, [600.0, 0.0, 300.0], [180.0 - 10.0 * c, 0.0, 45.0 + 20.0 * d]),
        (
            3.0 * PI,
            [400.0, 0.0, 280.0],
            [180.0 - 10.0 * (2.1 * PI).sin(), 0.0, 45.0 + 20.0 * (0.9 * PI).cos()],
        ),
    ];
    for (t, position, wpr) in around {
        let pose = circle(Duration::from_secs_f64(t));
        let is_near = |a: [f64; 3], b: [f64; 3]| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-5);
        assert!(is_near(pose.position, position) && is_near(pose.wpr, wpr), "{t}: {pose:?}");
    }
}

/// A poll every 80 ms for an hour, while the controller is busy for a second and freezes for another one.
#[test]
fn an_hour_of_telemetry() {
    let robot = Fanuc { faults: "busy:600-601".parse().unwrap(), ..Fanuc::default() };
    let config = ClientConfig { timeout: 100 * MS, ..ClientConfig::tcp() };
    let mut bench = robot.bench(Client::<1>::new(config).unwrap()).unwrap();
    bench.faults().follow(Script::new().at(1200 * S, Fault::Freeze(S)));
    bench.run_for(10 * MS);
    let (mut blocks, mut busy, mut late) = (0u64, 0u64, 0u64);
    while bench.now() < 3600 * S {
        let next = bench.now() + 80 * MS;
        bench.session_mut().request(1, &Request::ReadHoldingRegisters { address: 0, quantity: 37 }).unwrap();
        let event = loop {
            match bench.next_event(S) {
                Some(ClientEvent::Stray { .. }) => {}
                event => break event,
            }
        };
        match event {
            Some(ClientEvent::Replied { ticket, .. }) => match bench.session().reply(ticket) {
                Some(Reply::HoldingRegisters(_)) => blocks += 1,
                Some(Reply::Exception { exception: Exception::ServerDeviceBusy, .. }) => busy += 1,
                other => panic!("{other:?}"),
            },
            Some(ClientEvent::Failed { failure: Failure::TimedOut, .. }) => late += 1,
            other => panic!("{other:?}"),
        }
        bench.run_for(next.saturating_sub(bench.now()));
    }
    assert!(
        blocks > 44_900 && (12..=13).contains(&busy) && (8..=11).contains(&late),
        "{blocks} {busy} {late}"
    );
}

/// The same script, seed and calls: the same run, to the bit that is turned over.
#[test]
fn an_answer_comes_twice_and_every_run_is_the_same() {
    let run = |seed| {
        let config = ClientConfig { timeout: 10 * MS, settle: 20 * MS, ..ClientConfig::tcp() };
        let mut bench = Fanuc::default().bench(Client::<1>::new(config).unwrap()).unwrap();
        let script = Script::new().seed(seed).answer(2, Fault::Twice).every_answer(5, Fault::Corrupt);
        bench.faults().follow(script);
        bench.run_for(10 * MS);
        let mut events = Vec::new();
        for _ in 0..40 {
            let request = Request::ReadHoldingRegisters { address: 99, quantity: 2 };
            if bench.session_mut().request(1, &request).is_ok() {
                events.extend(bench.next_event(10 * S).map(|event| (bench.now(), format!("{event:?}"))));
            }
            bench.run_for(20 * MS);
            let now = bench.now();
            events.extend(bench.take_events().map(|event| (now, format!("{event:?}"))));
            if events.last().is_some_and(|(_, event)| event.starts_with("OutOfStep")) {
                bench.disconnect();
                bench.run_for(200 * MS);
            }
        }
        events
    };
    let first = run(1);
    let strays = first.iter().filter(|(_, event)| event.starts_with("Stray { transaction: Some(2),")).count();
    assert!(strays == 1 && first.len() > 30, "{first:?}");
    assert_eq!(run(1), first);
    assert_ne!(run(2), first);
}

fn bench(faults: &str) -> Bench<Client<1>, FanucController> {
    let robot = Fanuc { faults: faults.parse().unwrap(), ..Fanuc::default() };
    robot.bench(Client::<1>::new(ClientConfig::tcp()).unwrap()).unwrap()
}

/// Returns the telemetry of the background task at this time.
fn telemetry(bench: &mut Bench<Client<1>, FanucController>, at: Duration) -> TelemetryBlock {
    bench.run_for(at - bench.now());
    let mut controller = bench.device().controller();
    controller.tick(at);
    let registers = controller.tables_mut().holding_registers.first_chunk().unwrap();
    TelemetryBlock::from_registers(registers, WordOrder::LowFirst)
}

#[test]
fn telemetry_is_implausible_as_long_as_the_fault_is_there() {
    let mut sound = bench("");
    let mut faulty = bench("nan:1-2,infinite:2-3,quaternion:3-4,denormal:4-5,unreachable:5-6,standstill:7-8");
    let mut at = |ms: u32| (telemetry(&mut sound, MS * ms), telemetry(&mut faulty, MS * ms));
    let (block, found) = at(500);
    assert_eq!(found, block);
    let (block, found) = at(1500);
    assert!(found.velocity[0].is_nan() && found.position == block.position);
    let (block, found) = at(2500);
    let wpr = [block.wpr[0], block.wpr[1], f32::INFINITY];
    assert_eq!(found, TelemetryBlock { wpr, ..block });
    let (block, found) = at(3500);
    let [_, q2, q3, q4] = block.quaternion;
    assert_eq!(found, TelemetryBlock { quaternion: [2.0, q2, q3, q4], ..block });
    for (ms, beyond) in [(4500, false), (5500, true)] {
        let (block, found) = at(ms);
        let [x, y, z] = block.position;
        let position = [if beyond { x + 5000.0 } else { 1e-40 }, y, z];
        assert_eq!(found, TelemetryBlock { position, ..block });
    }
    let (block, found) = at(6500);
    assert_eq!(found, block);
    // The task has stopped, and with it all that it shows.
    let ((block, first), (later, last)) = (at(7200), at(7800));
    assert_ne!(block.position, later.position);
    assert_eq!(first, last);
}

#[test]
fn a_controller_that_is_away_ends_the_connection_and_says_why() {
    let mut bench = bench("disconnect:2-3");
    bench.run_for(1900 * MS);
    assert_eq!(bench.told(), []);
    bench.session_mut().request(1, &Request::ReadCoils { address: 0, quantity: 1 }).unwrap();
    bench.run_for(50 * MS);
    let told: Vec<_> = bench.told().iter().map(|(_, told)| told.clone()).collect();
    let read = FanucEvent::Read { table: Table::Coils, address: 0, count: 1 };
    let [
        SimulatorReport::Device(first),
        SimulatorReport::Device(FanucEvent::Server(ServerEvent::Served { function: 1, .. })),
    ] = &told[..]
    else {
        panic!("{told:?}")
    };
    assert_eq!(*first, read);
    bench.run_for(S);
    let away =
        bench.told().iter().filter(|(_, told)| *told == SimulatorReport::Close("the fault `disconnect`"));
    let away: Vec<Duration> = away.map(|(at, _)| *at).collect();
    assert!(!away.is_empty() && away.iter().all(|at| (2 * S..3 * S).contains(at)), "{away:?}");
}

#[test]
fn what_is_out_of_step_ends_the_connection() {
    let mut bench = bench("");
    bench.run_for(10 * MS);
    let now = bench.now();
    let server = bench.device_mut().session_mut();
    cellwire_sim::robot_session::Session::handle_input(server, now, &[0xff; 64]);
    bench.run_for(10 * MS);
    let told: Vec<_> = bench.told().iter().map(|(_, told)| told.clone()).collect();
    let is_out =
        |told: &_| matches!(told, SimulatorReport::Device(FanucEvent::Server(ServerEvent::OutOfStep(_))));
    assert!(told.iter().any(is_out), "{told:?}");
    assert!(told.contains(&SimulatorReport::Close("the client is out of step")), "{told:?}");
}

/// "Off by one": every third input is on, from the third one on.
#[test]
fn signals_and_registers_are_numbered_from_1() {
    let tables = Tables::numbered();
    let inputs = (1..=9).map(|n| tables.signal(Signal::Di(n)).unwrap());
    assert_eq!(inputs.collect::<Vec<_>>(), [0, 0, 1, 0, 0, 1, 0, 0, 1]);
    assert_eq!(tables.signal(Signal::R(7)), Some(7));
}

#[test]
fn a_program_sees_the_registers_that_a_client_has_written() {
    use core::ops::Range;
    use std::sync::mpsc::{Sender, channel};
    struct Log(Sender<(Range<usize>, Vec<u16>)>);
    impl Program for Log {
        fn run(&mut self, _: Duration, _: u32, _: &TelemetryFaults, _: &mut Tables) {}
        fn written(&mut self, registers: Range<usize>, tables: &Tables) {
            let values = tables.holding_registers[registers.clone()].to_vec();
            self.0.send((registers, values)).unwrap();
        }
        fn show(&mut self, _: &mut Tables) {}
    }
    let (log, written) = channel();
    let mut controller = Controller::running(Box::new(Log(log)), WordOrder::LowFirst);
    controller.write_registers(10, Words::from(&[7, 8, 9])).unwrap();
    assert_eq!(written.try_recv().unwrap(), (10..13, vec![7, 8, 9]));
    controller.set_values(Table::HoldingRegisters, 11, &[5, 6]).unwrap();
    assert_eq!(written.try_recv().unwrap(), (11..13, vec![5, 6]));
}

/// Returns the reply to a request.
fn reply<T>(
    bench: &mut Bench<Client<1>, FanucController>,
    request: &Request<'_>,
    read: impl FnOnce(Reply<'_>) -> T,
) -> T {
    bench.session_mut().request(1, request).unwrap();
    match bench.next_event(S) {
        Some(ClientEvent::Replied { ticket, .. }) => read(bench.session().reply(ticket).unwrap()),
        other => panic!("{other:?}"),
    }
}

#[test]
fn each_table_is_read_up_to_its_end_and_by_nobody_while_the_controller_is_busy() {
    let mut bench = bench("busy:2-3");
    bench.run_for(10 * MS);
    let mut inputs = |address: u16, quantity: u16| {
        let bits =
            reply(&mut bench, &Request::ReadDiscreteInputs { address, quantity }, |reply| match reply {
                Reply::DiscreteInputs(bits) => Ok(bits.iter().take(quantity.into()).collect::<Vec<_>>()),
                Reply::Exception { exception, .. } => Err(exception),
                other => panic!("{other:?}"),
            });
        let (address, quantity) = (address / 7, quantity);
        let words =
            reply(&mut bench, &Request::ReadInputRegisters { address, quantity }, |reply| match reply {
                Reply::InputRegisters(words) => Ok(words.iter().collect::<Vec<_>>()),
                Reply::Exception { exception, .. } => Err(exception),
                other => panic!("{other:?}"),
            });
        (bits, words)
    };
    let (yes, no) = (true, false);
    assert_eq!(inputs(0, 4), (Ok(vec![no, no, yes, no]), Ok(vec![1, 2, 3, 4])));
    assert_eq!(inputs(27_995, 1), (Ok(vec![yes]), Ok(vec![4000])));
    assert_eq!(inputs(27_998, 2).0, Ok(vec![yes, no]));
    let beyond = Exception::IllegalDataAddress;
    assert_eq!(inputs(28_000, 1), (Err(beyond), Err(beyond)));
    bench.run_for(2 * S + 500 * MS - bench.now());
    for request in [
        Request::ReadDiscreteInputs { address: 0, quantity: 1 },
        Request::ReadInputRegisters { address: 0, quantity: 1 },
        Request::ReadCoils { address: 0, quantity: 1 },
        Request::ReadHoldingRegisters { address: 0, quantity: 1 },
    ] {
        reply(&mut bench, &request, |reply| {
            assert!(
                matches!(reply, Reply::Exception { exception: Exception::ServerDeviceBusy, .. }),
                "{reply:?}"
            );
        });
    }
}

#[test]
fn what_clients_have_written_is_forgotten_and_the_connection_goes_on() {
    let mut bench = bench("");
    bench.run_for(10 * MS);
    reply(&mut bench, &Request::WriteRegister { address: 299, value: 9 }, |_| ());
    let written =
        |bench: &Bench<_, FanucController>| bench.device().controller().tables_mut().signal(Signal::R(300));
    assert_eq!(written(&bench), Some(9));
    bench.faults().forget();
    bench.run_for(10 * MS);
    assert_eq!(written(&bench), Some(300), "as at first");
    reply(&mut bench, &Request::ReadCoils { address: 0, quantity: 1 }, |reply| {
        assert!(matches!(reply, Reply::Coils(_)), "{reply:?}");
    });
    assert!(!bench.told().iter().any(|(_, told)| matches!(told, SimulatorReport::Close(_))));
}

#[test]
fn a_signal_of_each_table_is_set_and_one_beyond_it_is_not() {
    let mut tables = Tables::empty();
    for signal in [Signal::Di(3), Signal::Do(3), Signal::Gi(3), Signal::R(3)] {
        let is_bit = matches!(signal, Signal::Di(_) | Signal::Do(_));
        for value in [7, 0, 1] {
            assert_eq!(tables.set_signal(signal, value), Some(()));
            let expected = if is_bit { u16::from(value != 0) } else { value };
            assert_eq!(tables.signal(signal), Some(expected), "{signal:?}");
        }
    }
    for signal in [Signal::Di(0), Signal::Di(10_001), Signal::R(0), Signal::R(16_385)] {
        assert_eq!((tables.set_signal(signal, 1), tables.signal(signal)), (None, None), "{signal:?}");
    }
}

#[test]
fn faults_with_their_times_are_those_of_their_text() {
    let faults = TelemetryFaults::default()
        .with(TelemetryFault::Nan, S..3 * S / 2)
        .with(TelemetryFault::Busy, 2 * S..3 * S);
    assert_eq!(Ok(faults), "nan:1-1.5,busy:2-3".parse());
}

/// The program runs every 8 ms, even when nothing has read in between; the number is that of the task, which a fault
/// has restarted.
#[test]
fn a_program_runs_once_in_each_period_of_the_background_task() {
    use std::sync::mpsc::{Sender, channel};
    struct Log(Sender<(Duration, u32)>);
    impl Program for Log {
        fn run(&mut self, at: Duration, number: u32, _: &TelemetryFaults, _: &mut Tables) {
            self.0.send((at, number)).unwrap();
        }
        fn written(&mut self, _: core::ops::Range<usize>, _: &Tables) {}
        fn show(&mut self, tables: &mut Tables) {
            tables.holding_registers[0] += 1;
        }
    }
    let (log, runs) = channel();
    let faults = TelemetryFaults::default().with(TelemetryFault::Restart, 24 * MS..S);
    let mut controller = Controller::running(Box::new(Log(log)), WordOrder::LowFirst).with_faults(faults);
    let mut after = |at: Duration| {
        controller.tick(at);
        let runs: Vec<_> = runs.try_iter().collect();
        (runs, controller.tables_mut().holding_registers[0])
    };
    assert_eq!(after(Duration::ZERO), (vec![(Duration::ZERO, 0)], 1));
    assert_eq!(after(7 * MS), (vec![], 1));
    assert_eq!(after(23 * MS), (vec![(8 * MS, 1), (16 * MS, 2)], 2));
    assert_eq!(after(40 * MS), (vec![(24 * MS, 0), (32 * MS, 1), (40 * MS, 2)], 3));
}

#[test]
fn a_controller_that_was_restarted_has_its_registers_and_counts_from_0() {
    let mut bench = bench("");
    reply(&mut bench, &Request::WriteRegister { address: 300, value: 9 }, |_| ());
    let served = |bench: &Bench<_, FanucController>| bench.device().session().statistics().served;
    assert_eq!(served(&bench), 1);
    bench.faults().restart(100 * MS);
    bench.run_for(S);
    assert_eq!(served(&bench), 0);
    assert_eq!(bench.device().controller().values(Table::HoldingRegisters, 300, 1), Some(vec![9]));
}
