//! The viewer link: its packets, its stream decoder, and both ends on any line at any time.

use core::time::Duration;

use arbitrary::Unstructured;
use val2_viewer::robot_session::{Encode as _, Session as _};
use val2_viewer::{
    Decoder, ENQ, Host, HostConfig, HostEvent, PosePacket, Workstation, WorkstationConfig, WorkstationEvent,
    XOFF, XON,
};

use crate::{codecs, step, written};

const GOOD: PosePacket =
    PosePacket { count: 7, pose: [16384, 0, 0, 0, -16384, 0, 0, 0, -16384, 12800, -4816, 16] };

/// The first byte is how long the reads are, the rest the stream.
pub fn val2_viewer_decoder(data: &[u8]) {
    let Some((&size, stream)) = data.split_first() else { return };
    codecs::decoder(&Sent, stream, size);
}

/// What the host sends.
pub(crate) struct Sent;

impl codecs::Side for Sent {
    type Decoder = Decoder;
    type Frame = PosePacket;

    fn decoder(&self) -> Decoder {
        Decoder::new()
    }

    fn keep(&self, packet: PosePacket) -> PosePacket {
        packet
    }

    fn check(&self, packet: &PosePacket, _: &[u8], bytes: &[u8]) {
        assert_eq!(PosePacket::decode(bytes), Ok(Some((*packet, bytes.len()))));
        let encoded = written(packet.encoded_len(), |out| packet.encode(out));
        assert_eq!(encoded.as_deref(), Ok(bytes), "an accepted packet encodes to its bytes");
    }

    fn good(&self, _: usize) -> (PosePacket, Vec<u8>) {
        let mut bytes = vec![0; GOOD.encoded_len()];
        GOOD.encode(&mut bytes).unwrap();
        (GOOD, bytes)
    }
}

/// A packet of any values: what is written is read back the same.
pub fn val2_viewer_message(data: &[u8]) {
    let mut input = Unstructured::new(data);
    let Ok((count, pose)) = input.arbitrary::<(u16, [i16; 12])>() else { return };
    let packet = PosePacket { count, pose };
    let bytes = written(packet.encoded_len(), |out| packet.encode(out)).unwrap();
    assert_eq!(PosePacket::decode(&bytes), Ok(Some((packet, bytes.len()))));
    assert!(!bytes.iter().any(|byte| [XON, XOFF].contains(byte)), "XON, XOFF");
    for whole in 0..bytes.len() {
        assert_eq!(PosePacket::decode(&bytes[..whole]), Ok(None), "{whole} bytes are no packet");
    }
}

/// Steps of an action, a pause in units of 10 ms, a length, and so many bytes from the line.
pub fn val2_viewer_host(mut data: &[u8]) {
    let config = HostConfig::default();
    let mut host = Host::new(config).unwrap();
    let (mut now, mut out) = (Duration::ZERO, [0; Host::MAX_TRANSMIT]);
    let (mut connected, mut asked, mut held) = (None, false, None);
    let (mut last, mut newest) = (None, None);
    while let Some(([action, pause, _], bytes)) = step(&mut data) {
        now += Duration::from_millis(10 * u64::from(pause));
        match action & 7 {
            0 => {
                host.handle_disconnected(now);
                (connected, asked, held) = (None, false, None);
            }
            1 => {
                host.handle_connected(now);
                (connected, asked, held) = (Some(now), false, None);
            }
            2..5 => {
                let pose = [i16::from(pause) << (action >> 4); 12];
                host.set_pose(now, pose);
                newest = Some((now, pose));
            }
            _ => {}
        }
        host.handle_input(now, bytes);
        asked |= connected.is_some() && bytes.contains(&ENQ);
        hold(&mut held, now, bytes);
        if action & 8 != 0 {
            continue; // the caller is late
        }
        let events = core::iter::from_fn(|| host.poll_event()).count();
        assert!(events <= 8, "the queue is bounded");
        if let Some(length) = host.poll_transmit(now, &mut out) {
            assert!(core::mem::take(&mut asked), "the host sends nothing unasked");
            assert!(held.is_none_or(|at| now - at >= config.max_hold), "it is held");
            let (packet, used) = PosePacket::decode(&out[..length]).unwrap().unwrap();
            let (at, pose) = newest.unwrap();
            assert!(packet.pose == pose && now - at < config.max_age, "the newest pose");
            assert!(connected.is_some_and(|at| now - at >= config.interval), "requests pile up");
            assert!(last.is_none_or(|last| now - last >= config.interval), "answered too fast");
            (last, out[0]) = (Some(now), 0);
            assert_eq!((used, host.poll_event()), (length, Some(HostEvent::Sent(packet))));
        }
        assert_eq!(host.poll_transmit(now, &mut out), None, "one answer at a time");
        assert!(host.poll_timeout().is_none_or(|at| at > now));
    }
}

/// When XOFF has come, if no XON has since.
fn hold(held: &mut Option<Duration>, now: Duration, bytes: &[u8]) {
    if let Some(last) = bytes.iter().rev().find(|byte| [XON, XOFF].contains(byte)) {
        *held = (*last == XOFF).then_some(now);
    }
}

/// The same. Poses come from the line only.
pub fn val2_viewer_workstation(mut data: &[u8]) {
    let config = WorkstationConfig::default();
    let mut workstation = Workstation::new(config).unwrap();
    let (mut now, mut out) = (Duration::ZERO, [0; 1]);
    let (mut connected, mut open, mut is_live, mut last_draw) = (false, false, false, None::<Duration>);
    let mut asked = Duration::ZERO;
    // A request was sent, and no line has come since.
    let (mut credit, mut awaited, mut held) = (true, false, None);
    let line = written(GOOD.encoded_len(), |out| GOOD.encode(out)).unwrap();
    while let Some(([action, pause, _], bytes)) = step(&mut data) {
        now += Duration::from_millis(10 * u64::from(pause));
        match action & 7 {
            0 => {
                workstation.handle_disconnected(now);
                (connected, awaited, held) = (false, false, None);
            }
            1 => {
                workstation.handle_connected(now);
                (connected, credit, awaited, held) = (true, true, false, None);
            }
            2 => workstation.handle_input(now, &line),
            3.. => {
                workstation.draw(now);
                credit |= last_draw.replace(now).is_none_or(|last| now - last >= config.pause);
            }
        }
        if connected {
            workstation.handle_input(now, bytes);
            hold(&mut held, now, bytes);
        }
        workstation.handle_timeout(now);
        let mut events = 0;
        while let Some(event) = workstation.poll_event() {
            events += 1;
            assert!(events <= 8, "the queue is bounded");
            let is_line = match event {
                WorkstationEvent::Pose(_) | WorkstationEvent::Unasked(_) => true,
                WorkstationEvent::Corrupt(error) => error.is_line(),
                _ => false,
            };
            credit |= is_line && core::mem::take(&mut awaited);
            match event {
                WorkstationEvent::Pose(_) | WorkstationEvent::Missed => {
                    assert!(core::mem::take(&mut open), "a request has one outcome");
                    is_live |= matches!(event, WorkstationEvent::Pose(_));
                }
                WorkstationEvent::Stale => {
                    assert!(core::mem::take(&mut is_live), "stale, once");
                }
                WorkstationEvent::Unexpected(unexpected) => {
                    assert!(!connected && action & 7 == 2, "{unexpected}");
                }
                _ => {}
            }
        }
        assert_eq!(workstation.live_until().is_some(), is_live);
        assert!(!open || now < asked + config.stale_after, "a request that is not answered is missed");
        assert!(workstation.live_until().is_none_or(|until| now < until));
        if workstation.poll_transmit(now, &mut out).is_some() {
            assert_eq!(out, [ENQ]);
            assert!(connected && core::mem::take(&mut credit), "a credit of one");
            assert!(held.is_none_or(|at| now - at >= config.max_hold), "it is held");
            assert!(!core::mem::replace(&mut open, true), "one request at a time");
            (awaited, asked) = (true, now);
        }
        assert_eq!(workstation.poll_transmit(now, &mut out), None, "one request at a time");
        assert!(workstation.poll_timeout().is_none_or(|at| at > now));
    }
}
