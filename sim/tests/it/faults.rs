//! The effects of each fault on its message, the connection and the device, and their times.

use core::time::Duration;

use cellwire_sim::robot_session::Session;
use cellwire_sim::{
    Device as _, Fanuc, Fault, Faults, Peer, Script, Settings as _, Simulator, SimulatorReport,
};

use crate::gadget::{Gadget, Line, bench};

const MS: Duration = Duration::from_millis(1);
const NOW: Duration = Duration::ZERO;

/// Returns the logs of both ends when the script's fault happens to the first of two messages.
fn logs(
    script: Script,
    of_device: &[(Duration, &'static str)],
    of_host: &[(Duration, &'static str)],
) -> [Vec<String>; 2] {
    let gadget = Gadget { line: Line::sending(of_device), ..Gadget::default() };
    let mut bench = bench(Line::sending(of_host), gadget);
    bench.faults().follow(script);
    bench.run_for(200 * MS);
    [bench.device().line.log.clone(), bench.session().log.clone()]
}

#[test]
fn a_fault_of_an_answer_happens_to_that_answer() {
    let host = |fault| {
        let [_, host] = logs(Script::new().answer(1, fault), &[(NOW, "ABCD"), (NOW, "EF")], &[]);
        host
    };
    assert_eq!(host(Fault::Drop), ["0ns connected", "0ns EF"]);
    assert_eq!(host(Fault::Delay(5 * MS)), ["0ns connected", "5ms ABCD", "5ms EF"]);
    assert_eq!(host(Fault::Freeze(5 * MS)), ["0ns connected", "5ms ABCD", "5ms EF"]);
    assert_eq!(host(Fault::Twice), ["0ns connected", "0ns ABCD", "0ns ABCD", "0ns EF"]);
    let ends = ["0ns connected", "0ns disconnected", "100ms connected", "100ms EF"];
    assert_eq!(host(Fault::Close), ends);
    assert_eq!(host(Fault::Restart(5 * MS)), ends);
    assert_eq!(
        host(Fault::Cut),
        ["0ns connected", "0ns AB", "0ns disconnected", "100ms connected", "100ms EF"]
    );
    let [_, one_byte] = logs(Script::new().answer(1, Fault::Cut), &[(NOW, "A"), (NOW, "EF")], &[]);
    assert_eq!(one_byte, ends, "half of one byte is none");
}

#[test]
fn a_fault_of_a_request_happens_to_that_request() {
    let device = |fault| {
        let [device, _] = logs(Script::new().request(1, fault), &[], &[(NOW, "ABCD"), (MS, "EF")]);
        device
    };
    assert_eq!(device(Fault::Drop), ["0ns connected", "1ms EF"]);
    assert_eq!(device(Fault::Delay(5 * MS)), ["0ns connected", "5ms ABCD", "5ms EF"]);
    assert_eq!(device(Fault::Freeze(5 * MS)), ["0ns connected", "5ms ABCD", "5ms EF"]);
    assert_eq!(device(Fault::Twice), ["0ns connected", "0ns ABCD", "0ns ABCD", "1ms EF"]);
    let ends = ["0ns connected", "0ns disconnected", "100ms connected", "100ms EF"];
    assert_eq!(device(Fault::Close), ends);
    let cut = device(Fault::Cut);
    assert_eq!(cut, ["0ns connected", "0ns AB", "0ns disconnected", "100ms connected", "100ms EF"]);
}

#[test]
fn a_device_closes_when_its_last_message_has_left() {
    let host = |fault| {
        let line = Line::sending(&[(NOW, "ABCD")]);
        let mut bench = bench(Line::default(), Gadget { line, work: Some(NOW), closes: true });
        bench.faults().follow(Script::new().answer(1, fault));
        bench.run_for(50 * MS);
        bench.session().log.clone()
    };
    assert_eq!(host(Fault::Delay(5 * MS)), ["0ns connected", "5ms ABCD", "5ms disconnected"]);
    assert_eq!(host(Fault::Twice), ["0ns connected", "0ns ABCD", "0ns ABCD", "0ns disconnected"]);
}

/// Runs a device that has something to do in each direction while a fault of 2 ms lasts, until 12 ms.
fn while_away(fault: Fault) -> ([Vec<String>; 2], Vec<Duration>) {
    let line = Line { wake: Some(4 * MS), ..Line::sending(&[(6 * MS, "CD")]) };
    let host = Line { wake: Some(7 * MS), ..Line::sending(&[(3 * MS, "AB")]) };
    let mut bench = bench(host, Gadget { line, work: Some(5 * MS), closes: false });
    bench.wire.reconnect = MS;
    bench.faults().follow(Script::new().at(2 * MS, fault));
    let mut stops = Vec::new();
    bench.run_until(50 * MS, |bench| {
        stops.push(bench.now());
        false
    });
    assert_eq!(bench.faults().happened(), [(2 * MS, fault)], "it happened at its time");
    ([bench.device().line.log.clone(), bench.session().log.clone()], stops)
}

#[test]
fn a_frozen_device_neither_reads_nor_sends_and_executes() {
    let ([device, host], _) = while_away(Fault::Freeze(10 * MS));
    assert_eq!(device, ["0ns connected", "5ms executes", "12ms wakes", "12ms AB"]);
    assert_eq!(host, ["0ns connected", "7ms wakes", "12ms CD"]);
}

#[test]
fn a_device_without_power_does_nothing_until_it_is_back() {
    let ([device, host], stops) = while_away(Fault::Restart(10 * MS));
    let back = ["12ms executes", "12ms wakes", "12ms connected", "12ms AB"];
    assert_eq!(device, [&["0ns connected", "2ms restarts", "2ms disconnected"][..], &back].concat());
    assert_eq!(host, ["0ns connected", "2ms disconnected", "7ms wakes", "12ms connected", "12ms CD"]);
    assert_eq!(stops, [0, 2, 3, 7, 12, 50].map(|ms| ms * MS), "the clock stops at what is due");
}

#[test]
fn what_needs_a_message_waits_for_the_next_answer() {
    let script = Script::new().at(MS, Fault::Drop);
    let [device, host] = logs(script, &[(NOW, "AB"), (3 * MS, "CD"), (4 * MS, "EF")], &[(2 * MS, "GH")]);
    assert_eq!(host, ["0ns connected", "0ns AB", "4ms EF"]);
    assert_eq!(device, ["0ns connected", "2ms GH"]);
}

fn connected() -> Simulator<Gadget> {
    let mut simulator = Simulator::new(Gadget::default());
    simulator.handle_connected(NOW);
    simulator
}

#[test]
fn a_device_is_held_by_its_faults_and_not_by_itself() {
    assert!(Simulator::new(Gadget::default()).is_held(), "there is no connection");
    let mut simulator = connected();
    assert!(!simulator.is_held());
    simulator.device_mut().line.is_blocked = true;
    assert!(!simulator.is_held() && !simulator.wants_input());
    let mut simulator = connected();
    simulator.faults().freeze(5 * MS);
    simulator.handle_timeout(NOW);
    assert!(simulator.is_held());
    simulator.handle_timeout(5 * MS);
    assert!(!simulator.is_held());
    simulator.faults().follow(Script::new().request(0, Fault::Delay(7 * MS)));
    simulator.handle_input(6 * MS, b"AB");
    assert!(simulator.is_held(), "its bytes wait");
}

#[test]
fn a_simulator_asks_to_be_woken_for_what_it_can_do_then() {
    let mut simulator = connected();
    let script =
        Script::new().at(5 * MS, Fault::Forget).at(2 * MS, Fault::Twice).request(1, Fault::Delay(7 * MS));
    simulator.faults().follow(script);
    assert_eq!(simulator.poll_timeout(), Some(5 * MS), "not for a fault that waits for a message");
    simulator.handle_timeout(5 * MS);
    assert_eq!((simulator.device().line.last(), simulator.poll_timeout()), ("5ms forgets", None));
    simulator.handle_input(6 * MS, b"AB");
    assert_eq!(simulator.poll_timeout(), Some(13 * MS));
    assert!(!simulator.wants_input(), "what comes next stays behind it");
    simulator.device_mut().line.is_blocked = true;
    simulator.handle_timeout(13 * MS);
    assert_eq!(simulator.poll_timeout(), None, "the device does not read");
    simulator.device_mut().line.is_blocked = false;
    simulator.handle_timeout(14 * MS);
    assert_eq!((simulator.device().line.last(), simulator.wants_input()), ("14ms AB", true));
}

#[test]
fn a_connection_that_is_to_be_closed_carries_nothing() {
    let mut simulator = connected();
    simulator.faults().next_answer(Fault::Close);
    simulator.device_mut().line.sends.extend([(NOW, "AB"), (NOW, "CD")]);
    let mut out = [0; 8];
    assert_eq!(
        (simulator.poll_transmit(NOW, &mut out), simulator.poll_transmit(NOW, &mut out)),
        (None, None)
    );
    assert!(!simulator.wants_input());
    let told = [simulator.poll_event(), simulator.poll_event()];
    assert!(
        matches!(told, [Some(SimulatorReport::Fault(Fault::Close)), Some(SimulatorReport::Close(_))]),
        "{told:?}"
    );
}

#[test]
fn one_more_connection_finds_the_device_as_it_is() {
    let mut first = connected().keeping_nothing();
    first.faults().freeze(10 * MS);
    first.handle_timeout(MS);
    let mut other = first.another().unwrap();
    other.handle_connected(2 * MS);
    assert!(!other.wants_input(), "frozen");
    other.device_mut().work = Some(3 * MS);
    other.handle_timeout(11 * MS);
    assert!(other.wants_input());
    assert_eq!(other.device().line.last(), "11ms executes");
    assert_eq!(other.poll_executed(), None, "nothing is kept");
    first.faults().restart(10 * MS);
    first.handle_timeout(20 * MS);
    let other = first.another().unwrap();
    assert_eq!([29 * MS, 30 * MS].map(|now| other.accepts(now)), [false, true], "off");
}

#[test]
fn what_is_called_for_happens_to_the_next_answer_and_what_is_taken_back_does_not() {
    type Call = fn(&Faults);
    let calls: [(Call, Fault); 5] = [
        (Faults::drop_next, Fault::Drop),
        (|faults| faults.delay_next(5 * MS), Fault::Delay(5 * MS)),
        (Faults::corrupt_next, Fault::Corrupt),
        (Faults::cut_next, Fault::Cut),
        (Faults::repeat_next, Fault::Twice),
    ];
    for (call, fault) in calls {
        for is_cleared in [false, true] {
            let mut simulator = connected();
            call(simulator.faults());
            if is_cleared {
                simulator.faults().clear();
            }
            simulator.device_mut().line.sends.push_back((NOW, "ABCD"));
            let _ = simulator.poll_transmit(NOW, &mut [0; 8]);
            let expected = if is_cleared { vec![] } else { vec![(NOW, fault)] };
            assert_eq!(simulator.faults().happened(), expected);
        }
    }
}

#[test]
fn a_script_that_is_cleared_is_over() {
    let mut simulator = connected();
    let script =
        Script::new().every_answer(1, Fault::Drop).every_request(1, Fault::Drop).at(MS, Fault::Forget);
    simulator.faults().follow(script);
    simulator.faults().clear();
    simulator.handle_timeout(2 * MS);
    simulator.handle_input(3 * MS, b"AB");
    assert_eq!((simulator.faults().happened(), simulator.device().line.last()), (vec![], "3ms AB"));
}

/// It has ended already: there is nothing more to close.
#[test]
fn nobody_is_told_to_close_a_connection_that_has_ended() {
    let mut simulator = connected();
    simulator.faults().next_answer(Fault::Close);
    simulator.device_mut().line.sends.push_back((NOW, "AB"));
    assert_eq!(simulator.poll_transmit(NOW, &mut [0; 8]), None);
    simulator.handle_disconnected(NOW);
    let told: Vec<_> = core::iter::from_fn(|| simulator.poll_event()).collect();
    assert_eq!(told, [SimulatorReport::Fault(Fault::Close)]);
}

#[test]
fn any_session_is_a_device_and_a_new_one_after_a_restart() {
    let mut device = Peer(Line::sending(&[(NOW, "AB")])).device().unwrap();
    device.session_mut().handle_connected(NOW);
    assert_eq!(device.session_mut().poll_transmit(NOW, &mut [0; 8]), Some(2));
    assert_eq!((device.session().last(), device.session().sends.len()), ("0ns connected", 0));
    device.restart(NOW);
    assert_eq!((device.session().log.len(), device.session().sends.len()), (0, 1));
}

#[test]
fn a_device_has_executed_what_came_on_any_of_its_connections() {
    let mut simulator = Fanuc::default().simulator().unwrap();
    let remote = simulator.remote();
    let mut another = simulator.another().unwrap();
    for connection in [&mut simulator, &mut another] {
        connection.handle_connected(NOW);
        connection.handle_input(NOW, &[0, 1, 0, 0, 0, 6, 1, 6, 1, 44, 0, 9]);
    }
    assert_eq!(remote.executed(0, 9).1.len(), 2);
}
