//! The loop and the codec for tokio.

use core::ops::ControlFlow;
use core::pin::Pin;
use core::task::{Context, Poll};
use core::time::Duration;
use std::io;

use crate::common::echo::{Echo, EchoEvent};
use crate::common::{Asker, Event, Line, Lines, TooLong};
use bytes::BytesMut;
use robot_session::tokio::{Closed, Codec, Driver, latest};
use robot_session::{EndReason, Session as _, now};
use tokio::io::{AsyncRead, AsyncReadExt as _, AsyncWrite, AsyncWriteExt as _, DuplexStream, ReadBuf};
use tokio_util::codec::{Decoder as _, Encoder as _};

fn go_on(_: &mut Asker, _: Event) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

#[tokio::test]
async fn a_session_runs_until_its_handler_breaks() {
    let (near, mut far) = tokio::io::duplex(64);
    tokio::spawn(async move {
        let mut byte = [0];
        while far.read(&mut byte).await.unwrap() == 1 {
            far.write_all(&byte).await.unwrap();
        }
    });
    let (mut session, mut seen) = (Asker::new(&["one", "two"]), Vec::new());
    let handler = |_: &mut Asker, event: Event| {
        seen.push(event.clone());
        if event == Event::Answer("two".into()) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let ended = Driver::new(near).drive(&mut session, handler).await.unwrap();
    assert_eq!(ended, EndReason::ByHandler(()));
    let answers = ["one", "two"].map(|text| Event::Answer(text.into()));
    assert_eq!(seen, [&[Event::Connected][..], &answers, &[Event::Disconnected]].concat());
}

#[tokio::test]
async fn the_end_of_the_stream_and_a_timeout_are_seen() {
    let (near, far) = tokio::io::duplex(64);
    let mut session = Asker::new(&["one"]);
    session.timeout = Duration::from_millis(20);
    let mut driver = Driver::new(near);
    let turn = driver.turn(&mut session, |_, event| ControlFlow::Break(event)).await.unwrap();
    assert_eq!(turn, ControlFlow::Break(EndReason::ByHandler(Event::NoAnswer("one".into()))));
    drop(far);
    let ended = driver.turn(&mut session, go_on).await.unwrap();
    assert_eq!(ended, ControlFlow::Break(EndReason::ByPeer));
}

#[tokio::test]
async fn nothing_is_sent_that_was_not_kept() {
    let (near, mut far) = tokio::io::duplex(64);
    let (mut session, mut driver, mut kept) = (Asker::new(&["one", "two"]), Driver::new(near), 0);
    let mut byte = [0];
    let keep = async |_: &mut Asker| {
        assert!(
            tokio::time::timeout(Duration::ZERO, far.read(&mut byte)).await.is_err(),
            "it is sent already"
        );
        kept += 1;
        Ok(())
    };
    let turn = driver.turn_with(&mut session, keep, go_on);
    assert!(tokio::time::timeout(Duration::from_millis(20), turn).await.is_err());
    assert_eq!(kept, 1);
    let mut sent = [0; 4];
    far.read_exact(&mut sent).await.unwrap();
    assert_eq!(&sent, b"one\n");
    far.write_all(b"one\n").await.unwrap();
    let keep = async |_: &mut Asker| Err(io::Error::other("the disk is full"));
    let error = loop {
        match driver.turn_with(&mut session, keep, go_on).await {
            Ok(turn) => assert!(turn.is_continue()),
            Err(error) => break error,
        }
    };
    assert_eq!(error.to_string(), "the disk is full");
    drop(driver);
    assert_eq!(far.read(&mut sent).await.unwrap(), 0);
}

#[tokio::test]
async fn an_address_without_a_port_is_said_to_be_none() {
    use robot_session::tokio::{Connector as _, Tcp};

    let error = Tcp::new("127.0.0.1").connect().await.unwrap_err();
    assert_eq!(error.to_string(), r#""127.0.0.1" is no address: give HOST:PORT, such as 192.168.0.10:502"#);
}

/// The deadline of a turn that was dropped wakes the task that waits now.
#[tokio::test(start_paused = true)]
async fn a_driver_goes_on_in_another_task() {
    let (near, _far) = tokio::io::duplex(64);
    let (mut session, mut driver) = (Asker::new(&["one"]), Driver::new(near));
    session.timeout = 2 * SHORT;
    let begin = now();
    assert!(tokio::time::timeout(SHORT, driver.turn(&mut session, go_on)).await.is_err());
    let next = tokio::spawn(async move {
        let turn = driver.turn(&mut session, |_, event| ControlFlow::Break(event));
        tokio::time::timeout(LONG, turn).await.unwrap().unwrap()
    });
    assert_eq!(next.await.unwrap(), ControlFlow::Break(EndReason::ByHandler(Event::NoAnswer("one".into()))));
    assert!((2 * SHORT..3 * SHORT).contains(&(now() - begin)));
}

/// The hook may take long: the session then gets the time after it.
#[tokio::test(start_paused = true)]
async fn a_deadline_that_passes_while_the_state_is_kept_is_seen_in_the_same_turn() {
    let (near, _far) = tokio::io::duplex(64);
    let (mut session, mut driver) = (Asker::new(&["one"]), Driver::new(near));
    session.timeout = SHORT;
    let keep = async |_: &mut Asker| {
        tokio::time::sleep(2 * SHORT).await;
        Ok(())
    };
    let turn = driver.turn_with(&mut session, keep, |_, event| ControlFlow::Break(event)).await.unwrap();
    assert_eq!(turn, ControlFlow::Break(EndReason::ByHandler(Event::NoAnswer("one".into()))));
}

/// The pipe takes three bytes at a time, and every future is dropped as soon as it waits.
#[tokio::test]
async fn a_dropped_turn_loses_nothing() {
    let (near, mut far) = tokio::io::duplex(3);
    let mut session = Asker::new(&["1234567", "second"]);
    let mut driver = Driver::new(near);
    let (mut arrived, mut dropped) = (Vec::new(), 0);
    while !arrived.ends_with(b"second\n") {
        let turn = driver.turn(&mut session, go_on);
        if tokio::time::timeout(Duration::ZERO, turn).await.is_err() {
            dropped += 1;
        }
        let mut bytes = [0; 3];
        if let Ok(length) = tokio::time::timeout(Duration::from_millis(1), far.read(&mut bytes)).await {
            arrived.extend(&bytes[..length.unwrap()]);
        }
        if arrived == b"1234567\n" && session.requests.len() == 1 {
            far.write_all(b"ok\n").await.unwrap();
        }
        assert!(dropped < 1000, "{arrived:?}");
    }
    assert_eq!(arrived, b"1234567\nsecond\n");
    assert!(dropped > 3, "{dropped}");
}

/// A peer that does not read does not delay any deadline, and its bytes are read.
#[tokio::test]
async fn a_peer_that_does_not_read_holds_up_nothing_else() {
    let (near, mut far) = tokio::io::duplex(4);
    let (mut driver, mut session) = (Driver::new(near), Asker::new(&["1234567", "second"]));
    session.timeout = SHORT;
    let begin = now();
    let end = |_: &mut Asker, event| ControlFlow::Break(event);
    let ended = tokio::time::timeout(LONG, driver.drive(&mut session, end)).await.unwrap().unwrap();
    assert_eq!(ended, EndReason::ByHandler(Event::Connected));
    let turn = tokio::time::timeout(LONG, driver.turn(&mut session, end)).await.unwrap().unwrap();
    assert_eq!(turn, ControlFlow::Break(EndReason::ByHandler(Event::NoAnswer("1234567".into()))));
    assert!(now() - begin >= SHORT);
    // The answer comes while most of the next request is not written.
    let mut session = Asker::new(&["second"]);
    let mut arrived = Vec::new();
    far.write_all(b"sec").await.unwrap();
    let turn = tokio::time::timeout(SHORT, driver.turn(&mut session, go_on)).await;
    assert!(turn.unwrap().unwrap().is_continue(), "it is read");
    while !arrived.ends_with(b"second\n") {
        let _ = tokio::time::timeout(Duration::ZERO, driver.turn(&mut session, go_on)).await;
        let mut bytes = [0; 3];
        if let Ok(length) = tokio::time::timeout(SHORT, far.read(&mut bytes)).await {
            arrived.extend(&bytes[..length.unwrap()]);
        }
    }
    assert_eq!(arrived, b"1234567\nsecond\n", "what was begun is written before");
}

#[tokio::test]
async fn what_a_session_does_not_want_yet_stays_in_the_pipe() {
    let (near, far) = tokio::io::duplex(7);
    let (mut reader, mut writer) = tokio::io::split(far);
    let requests: Vec<u8> = (0..=250).cycle().take(1000).collect();
    let peer = tokio::spawn({
        let requests = requests.clone();
        async move {
            let (mut answers, mut asked) = (Vec::new(), 0);
            while answers.len() < requests.len() {
                let mut byte = [0];
                tokio::select! {
                    length = reader.read(&mut byte) => {
                        assert_eq!(length.unwrap(), 1);
                        answers.push(byte[0]);
                    }
                    length = writer.write(&requests[asked..]), if asked < requests.len() => asked += length.unwrap(),
                }
            }
            (answers, reader, writer)
        }
    });
    let mut answered = 0;
    let handler = |_: &mut Echo, event| {
        assert!(matches!(event, EchoEvent::Answered(_)), "{event:?}");
        answered += 1;
        if answered == 1000 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let mut driver = Driver::new(near);
    let ended = driver.drive(&mut Echo::new(Duration::ZERO), handler).await.unwrap();
    assert_eq!(ended, EndReason::ByHandler(()));
    assert_eq!(peer.await.unwrap().0, requests);
}

/// Requests in flight are reported, and the next connection begins without any state of this one.
#[tokio::test]
async fn a_dropped_drive_ends_its_connection() {
    let (near, mut far) = tokio::io::duplex(4);
    let (mut driver, mut session, mut seen) = (Driver::new(near), Asker::new(&["1234567"]), Vec::new());
    let mut note = |_: &mut Asker, event: Event| {
        seen.push(event);
        ControlFlow::<()>::Continue(())
    };
    let drive = driver.drive(&mut session, &mut note);
    assert!(tokio::time::timeout(SHORT, drive).await.is_err());
    session.requests.push_back("two".into());
    let drive = driver.drive(&mut session, &mut note);
    assert!(tokio::time::timeout(SHORT, drive).await.is_err());
    let no_answer = |text: &str| Event::NoAnswer(text.into());
    let first = [Event::Connected, no_answer("1234567"), Event::Disconnected];
    assert_eq!(seen, [&first[..], &[Event::Connected, no_answer("two"), Event::Disconnected]].concat());
    let mut arrived = [0; 4];
    far.read_exact(&mut arrived).await.unwrap();
    assert_eq!(&arrived, b"1234", "what had no room is not written any more");
}

const LONG: Duration = Duration::from_secs(20);
const SHORT: Duration = Duration::from_millis(20);

#[tokio::test]
async fn a_wake_ends_the_wait_and_the_next_turn_does_not_wait() {
    let (near, _far) = tokio::io::duplex(64);
    // The session has no deadline, and nothing to send.
    let (mut driver, mut session) = (Driver::new(near), Asker::new(&[]));
    let waker = driver.waker();
    for wakes in 1..4 {
        (0..wakes).for_each(|_| waker.wake());
        for _ in 0..2 {
            let turn = tokio::time::timeout(LONG, driver.turn(&mut session, go_on)).await;
            assert!(turn.unwrap().unwrap().is_continue());
        }
        let turn = tokio::time::timeout(SHORT, driver.turn(&mut session, go_on)).await;
        assert!(turn.is_err(), "however often, it is woken once");
    }
    let other = std::thread::spawn(move || waker.wake());
    let turn = tokio::time::timeout(LONG, driver.turn(&mut session, go_on)).await;
    assert!(turn.unwrap().unwrap().is_continue());
    other.join().unwrap();
}

#[tokio::test]
async fn without_a_wish_for_input_a_turn_waits_for_the_deadline_or_a_wake() {
    let (near, mut far) = tokio::io::duplex(64);
    let mut driver = Driver::new(near);
    let go_on = |_: &mut Echo, _| ControlFlow::<()>::Continue(());
    let mut session = Echo::new(3 * SHORT);
    session.handle_connected(now());
    far.write_all(b"ab").await.unwrap();
    assert!(driver.turn(&mut session, go_on).await.unwrap().is_continue());
    assert!(!session.wants_input());
    let begin = now();
    assert!(driver.turn(&mut session, go_on).await.unwrap().is_continue());
    assert!(now() - begin >= 2 * SHORT);
    let mut session = Echo::new(Duration::MAX);
    session.handle_connected(now());
    far.write_all(b"cd").await.unwrap();
    assert!(driver.turn(&mut session, go_on).await.unwrap().is_continue());
    driver.waker().wake();
    assert!(!session.wants_input());
    let turn = tokio::time::timeout(LONG, driver.turn(&mut session, go_on)).await;
    assert!(turn.unwrap().unwrap().is_continue());
}

/// A pipe that counts its flushes, of which the first ones must wait.
struct Flushed {
    pipe: DuplexStream,
    flushes: usize,
    waits: usize,
}

impl AsyncRead for Flushed {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        Pin::new(&mut self.pipe).poll_read(context, buffer)
    }
}

impl AsyncWrite for Flushed {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.pipe).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        self.flushes += 1;
        if self.flushes > self.waits {
            return Poll::Ready(Ok(()));
        }
        context.waker().wake_by_ref();
        Poll::Pending
    }

    fn poll_shutdown(self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<io::Result<()>> {
        Poll::Ready(Ok(()))
    }
}

#[tokio::test(start_paused = true)]
async fn what_is_written_is_flushed_until_it_is_out_and_no_more() {
    for waits in [0, 1, 3] {
        let (pipe, _far) = tokio::io::duplex(64);
        let mut driver = Driver::new(Flushed { pipe, flushes: 0, waits });
        let mut session = Asker::new(&["one"]);
        let turn = tokio::time::timeout(SHORT, driver.turn(&mut session, go_on)).await;
        assert!(turn.is_err(), "it waits for the answer");
        assert_eq!(driver.transport_mut().flushes, waits + 1);
    }
}

#[tokio::test(start_paused = true)]
async fn a_latest_value_is_there_until_its_time_is_over_or_it_is_cleared() {
    let (source, mut latest) = latest();
    assert_eq!(latest.get(), None);
    source.set(1, Some(now() + SHORT));
    assert_eq!((latest.get(), latest.next().await), (Some(1), Ok(Some(1))));
    tokio::time::advance(LONG).await;
    assert_eq!(latest.get(), None);
    source.set(2, None);
    assert_eq!((latest.get(), latest.next().await), (Some(2), Ok(Some(2))));
    source.clear();
    assert_eq!(latest.get(), None);
    assert_eq!(latest.next().await, Ok(None));
    source.clear();
    assert!(tokio::time::timeout(SHORT, latest.next()).await.is_err(), "nothing has changed");
    // Without a source there is no latest value any more.
    source.set(3, None);
    assert_eq!(latest.next().await, Ok(Some(3)));
    drop(source);
    assert_eq!(latest.get(), None);
    assert_eq!((latest.next().await, latest.next().await), (Ok(None), Err(Closed)));
}

#[test]
fn the_codec_gives_every_line_and_every_error() {
    let mut codec = Codec::new(Lines::default(), |line: Line| line.0);
    let mut src = BytesMut::from(&b"one\ntoolongaline\nrest"[..]);
    let mut items = Vec::new();
    while let Some(item) = codec.decode(&mut src).unwrap() {
        items.push(item);
    }
    let line = |text: &str| Ok(text.to_string());
    assert_eq!(items, [line("one"), Err(TooLong), line("line")]);
    assert_eq!(codec.decode_eof(&mut src).unwrap(), Some(Err(TooLong)), "what is not whole is an error");
    assert_eq!(codec.decode_eof(&mut src).unwrap(), None);
}

#[test]
fn the_codec_writes_a_message_or_nothing() {
    let mut codec = Codec::new(Lines::default(), |line: Line| line);
    let mut out = BytesMut::from(&b"before\n"[..]);
    codec.encode(Line("one".into()), &mut out).unwrap();
    let error = codec.encode(Line("much too long".into()), &mut out).unwrap_err();
    assert_eq!(error.to_string(), "a line has at most 7 bytes");
    assert_eq!(out, &b"before\none\n"[..]);
}
