//! The rules of the language, each with the smallest program that shows it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::indexing_slicing)]

use core::task::Poll;
use core::time::Duration;

use as_interpreter::{Error, Host, Machine, Motion, NoHost, Program, Socket, Step};

fn load(lines: &str) -> Machine {
    let mut machine = Machine::new(Program::parse(&format!(".PROGRAM main ()\n{lines}\n.END\n")).unwrap());
    machine.start("main").unwrap();
    machine
}

fn run(lines: &str) -> Machine {
    let mut machine = load(lines);
    while machine.step(0, &mut NoHost).unwrap() == Step::Done {}
    machine
}

fn real(expression: &str) -> f32 {
    run(&format!("v = {expression}")).real("v").unwrap()
}

fn text(expression: &str) -> String {
    run(&format!("$v = {expression}")).text("$v").unwrap()
}

fn error(lines: &str) -> Error {
    let mut machine = load(lines);
    loop {
        match machine.step(0, &mut NoHost) {
            Ok(step) => assert_eq!(step, Step::Done, "{lines}"),
            Err(fault) => {
                assert_eq!(machine.step(0, &mut NoHost), Ok(Step::Ended), "the task has stopped");
                return fault.error;
            }
        }
    }
}

#[test]
fn reals_have_24_bits_and_truth_is_minus_one() {
    assert_eq!(real("16777216 + 1"), 16_777_216.0);
    assert_eq!(real("9999999 - 1"), 9_999_998.0);
    assert_eq!((real("TRUE"), real("FALSE"), real("3 > 2"), real("3 == 2")), (-1.0, 0.0, -1.0, 0.0));
    assert_eq!(
        (real("-7 MOD 3"), real("INT (-2.5)"), real("2 + 3 * 4"), real("(2 + 3) * 4")),
        (-1.0, -2.0, 14.0, 20.0)
    );
    assert_eq!(real("NOT 1 == 2 AND 3 <> 3 OR 2 <= 2"), -1.0);
    assert_eq!(error("a = 1 / 0"), Error::Division);
}

#[test]
fn a_string_ends_after_255_bytes() {
    let mut lines = String::from("$a = \"0123456789\"\nFOR .i = 1 TO 5\n$a = $a + $a\nEND\nn = LEN ($a)");
    let machine = run(&lines);
    assert_eq!((machine.real("n"), machine.truncations()), (Some(255.0), 1));
    lines += "\n$b = $RIGHT ($a, 5)";
    assert_eq!(run(&lines).text("$b").unwrap(), "01234");
}

#[test]
fn encode_has_a_leading_blank() {
    assert_eq!(
        (text("$ENCODE (50)"), text("$ENCODE (-50)"), text("$ENCODE (/L, 50)")),
        (" 50".into(), "-50".into(), "50".into())
    );
    assert_eq!(text("\"<\" + $ENCODE (/L, -9999999) + \">\""), "<-9999999>");
}

#[test]
fn strings_are_cut_and_searched_from_one_on() {
    assert_eq!((real("INSTR (\"a$b$\", \"$\")"), real("INSTR (\"ab\", \"x\")")), (2.0, 0.0));
    assert_eq!((text("$LEFT (\"abc\", 9)"), text("$RIGHT (\"abc\", 2)")), ("abc".into(), "bc".into()));
    assert_eq!(
        (text("$MID (\"abc\", 2)"), text("$MID (\"abc\", 2, 1)"), text("$MID (\"abc\", 4)")),
        ("bc".into(), "b".into(), "".into())
    );
    assert_eq!((real("VAL (\" -12x\")"), real("VAL (\"\")")), (-12.0, 0.0));
    assert_eq!(error("$a = $LEFT (\"abc\", -1)"), Error::Argument);
    assert_eq!(error("$a = $MID (\"abc\", 0)"), Error::Argument);
}

#[test]
fn what_has_no_value_cannot_be_read() {
    assert_eq!(error("a = b"), Error::Undefined);
    assert_eq!(error("a[1] = 1\nb = a[2]"), Error::Undefined);
    assert_eq!(error("a[1] = 1\nb = a"), Error::Undefined);
    assert_eq!(error("$a = 1\nb = LEN ($a)"), Error::Type);
    assert_eq!(error("a[10000] = 1"), Error::Index);
    assert_eq!(error("a[0.5] = 1"), Error::Index);
    assert_eq!(run("a[9999] = 7\nb = a[9999]").real("b"), Some(7.0));
    assert_eq!(Error::Index.number(), -103);
}

#[test]
fn blocks_are_left_at_their_ends() {
    let lines = "n = 0\nWHILE n < 5 DO\nIF n == 3 THEN\nhit = TRUE\nELSE\nmiss = n\nEND\nn = n + 1\nEND\nDO\nn = n - 2\nUNTIL n < 0\n\
        FOR .i = 3 TO 1\nn = 99\nEND\nFOR .i = 1 TO 3\nFOR .j = .i TO 3\nc[.i] = .j\nd = .i * .j\nEND\nEND";
    let machine = run(lines);
    assert_eq!(
        (machine.real("n"), machine.real("hit"), machine.real("miss"), machine.real("d")),
        (Some(-1.0), Some(-1.0), Some(4.0), Some(9.0))
    );
}

#[test]
fn parameters_are_copied_back_and_locals_are_not_shared() {
    let source = "
.PROGRAM twice (.x, .$t, .y)
  .y = .x * 2
  .x = 0
  .$t = .$t + \"!\"
  .own = 5
  IF .y > 10 THEN
    RETURN
  END
  .y = -1
.END
.PROGRAM main ()
  .own = 1
  a[2] = 21
  $t = \"t\"
  CALL twice (a[2], $t, r)
  CALL twice (3, \"u\", s)
  own = .own
.END";
    let mut machine = Machine::new(Program::parse(source).unwrap());
    let task = machine.start("main").unwrap();
    while machine.step(task, &mut NoHost).unwrap() == Step::Done {}
    assert_eq!(
        (machine.real("r"), machine.real("s"), machine.element("a", 2)),
        (Some(42.0), Some(-1.0), Some(0.0))
    );
    assert_eq!((machine.text("$t"), machine.real("own")), (Some("t!".into()), Some(1.0)));
    assert_eq!(machine.statements(task), 21);
    assert!(machine.start("nobody").is_err());
}

/// Between the two statements of one task the other one sets the flag.
#[test]
fn tasks_run_side_by_side_a_statement_at_a_time() {
    let source = ".PROGRAM a ()\nIF flag == 0 THEN\nseen = flag\nEND\n.END\n.PROGRAM b ()\nflag = 7\n.END\n.PROGRAM c ()\nWAIT flag == 7\nSIGNAL 2001, -5\n.END";
    let mut machine = Machine::new(Program::parse(source).unwrap());
    let [a, b, c] = ["a", "b", "c"].map(|name| machine.start(name).unwrap());
    assert!(machine.set_real("flag", 0.0) && !machine.set_real("none", 0.0));
    machine.set_signal(5, true);
    assert_eq!(machine.step(c, &mut NoHost), Ok(Step::Waits));
    machine.step(a, &mut NoHost).unwrap();
    machine.step(b, &mut NoHost).unwrap();
    machine.step(a, &mut NoHost).unwrap();
    assert_eq!(machine.real("seen"), Some(7.0));
    assert_eq!(
        (machine.step(c, &mut NoHost), machine.step(c, &mut NoHost)),
        (Ok(Step::Done), Ok(Step::Done))
    );
    assert!(machine.signal(2001) && !machine.signal(5));
    assert_eq!((machine.tasks(), machine.calls(c).next()), (3, Some("c")));
}

/// A host whose clock, sockets and arm are in the test's hands.
#[derive(Default)]
struct Bench {
    now: Duration,
    received: Vec<Vec<u8>>,
    sent: Vec<Vec<u8>>,
    moving: bool,
    path: Vec<Motion>,
    printed: Vec<String>,
}

impl Host for Bench {
    fn now(&self) -> Duration {
        self.now
    }

    fn connect(&mut self, since: Duration, timeout: Duration, ip: [u8; 4], port: u16) -> Poll<i32> {
        assert_eq!((ip, port), ([10, 0, 0, 2], 9000));
        if self.now < since + timeout { Poll::Pending } else { Poll::Ready(5) }
    }

    fn send(&mut self, _: Duration, _: Duration, socket: i32, strings: &[&[u8]]) -> Poll<i32> {
        assert_eq!(socket, 5);
        self.sent.extend(strings.iter().map(|string| string.to_vec()));
        Poll::Ready(0)
    }

    fn receive(&mut self, _: Duration, _: Duration, _: i32, longest: usize) -> Poll<(i32, Vec<Vec<u8>>)> {
        assert_eq!(longest, 255);
        Poll::Ready((0, self.received.clone()))
    }

    fn close(&mut self, socket: i32) -> i32 {
        -socket
    }

    fn sockets(&mut self) -> Vec<Socket> {
        vec![Socket { port: 9000, id: 5, error: -3 }]
    }

    fn give(&mut self, motion: Motion) -> Poll<()> {
        if self.moving {
            return Poll::Pending;
        }
        self.moving = true;
        self.path.push(motion);
        Poll::Ready(())
    }

    fn arrived(&mut self) -> Poll<()> {
        if self.moving { Poll::Pending } else { Poll::Ready(()) }
    }

    fn print(&mut self, task: usize, line: &str) {
        self.printed.push(format!("{task}: {line}"));
    }
}

#[test]
fn a_socket_is_the_hosts() {
    let mut machine = load(
        "ip[1] = 10\nip[2] = 0\nip[3] = 0\nip[4] = 2\nTCP_CONNECT s, 9000, ip[1], 1.5\n$o[1] = \"a\"\n$o[2] = \"b\"\n\
         TCP_SEND r, s, $o[1], 2, 1\nTCP_RECV r, s, $i[3], n, 1, 255\nTCP_CLOSE c, s\nTCP_STATUS m, .p[0], .s[0], .e[0], .u[0], .$a[0]\n\
         e = .e[0]\nPRINT \"n=\", n, $i[4]",
    );
    let mut bench = Bench { received: vec![b"xy".to_vec(), b"z".to_vec()], ..Bench::default() };
    let run = |machine: &mut Machine, bench: &mut Bench| loop {
        match machine.step(0, bench).unwrap() {
            Step::Done => {}
            step => return step,
        }
    };
    assert_eq!(run(&mut machine, &mut bench), Step::Waits);
    assert_eq!(machine.wakes_at(0), Some(Duration::from_millis(1500)));
    bench.now = Duration::from_millis(1500);
    assert_eq!(run(&mut machine, &mut bench), Step::Ended);
    assert_eq!((bench.sent.concat(), bench.printed), (b"ab".to_vec(), vec!["0: n=2z".into()]));
    assert_eq!(
        (machine.real("c"), machine.real("m"), machine.real("e")),
        (Some(-5.0), Some(1.0), Some(-3.0))
    );
}

#[test]
fn the_arm_moves_while_the_program_goes_on_until_break() {
    let mut machine = load(
        "TIMER (1) = 100\nSPEED 250 MM/S ALWAYS\nPOINT p = TRANS (1, 2, 3)\nLMOVE p + TRANS (0, 0, 10)\nbegun = TRUE\nJMOVE p\nBREAK\n\
         there = TRUE\nTWAIT 0.5\nt = TIMER (1)",
    );
    let mut bench = Bench::default();
    let mut run = |bench: &mut Bench| {
        while machine.step(0, bench).unwrap() == Step::Done {}
        (machine.real("begun"), machine.real("there"), machine.real("t"))
    };
    assert_eq!(run(&mut bench), (Some(-1.0), None, None));
    bench.moving = false;
    assert_eq!(run(&mut bench), (Some(-1.0), None, None), "BREAK waits for the second");
    bench.moving = false;
    assert_eq!(run(&mut bench), (Some(-1.0), Some(-1.0), None));
    bench.now = Duration::from_millis(500);
    assert_eq!(run(&mut bench).2, Some(100.5));
    let path: Vec<_> = bench.path.iter().map(|motion| (motion.straight, motion.to[2])).collect();
    assert_eq!(path, [(true, 13.0), (false, 3.0)]);
}
