//! The faulty link on its virtual clock.

use core::time::Duration;

use testkit::link::{Delivery, End, FaultCounts, Faults, Link};

const MS: Duration = Duration::from_millis(1);

fn drain(link: &mut Link, at: End) -> (Vec<u8>, Vec<usize>, bool) {
    let (mut bytes, mut sizes, mut closed) = (Vec::new(), Vec::new(), false);
    while let Some(delivery) = link.receive(at, Duration::MAX) {
        match delivery {
            Delivery::Bytes(chunk) => {
                sizes.push(chunk.len());
                bytes.extend(chunk);
            }
            Delivery::Closed => closed = true,
        }
    }
    (bytes, sizes, closed)
}

#[test]
fn tcp_cuts_and_glues_but_keeps_every_byte_in_order() {
    let faults = Faults { disconnect: 0.0, ..Faults::TCP };
    let mut link = Link::new(1, faults);
    let sent: Vec<u8> = (0..=255).cycle().take(10_000).collect();
    for chunk in sent.chunks(100) {
        link.send(End::A, MS, chunk);
    }
    let (bytes, sizes, closed) = drain(&mut link, End::B);
    assert_eq!(bytes, sent);
    assert!(!closed);
    assert!(sizes.iter().any(|s| *s < 100) && sizes.iter().any(|s| *s > 100), "{sizes:?}");
    assert_eq!(link.counts().corruption(), 0);
}

#[test]
fn the_pieces_of_a_send_may_be_apart() {
    let mut link = Link::new(1, Faults { split: 1.0, pause: 10 * MS, ..Faults::NONE });
    let (mut at, mut bytes) = (Vec::new(), Vec::new());
    link.send(End::A, Duration::ZERO, b"0123456789");
    while let Some(now) = link.next_delivery() {
        at.push(now);
        let Some(Delivery::Bytes(piece)) = link.receive(End::B, now) else { panic!() };
        bytes.extend(piece);
    }
    assert_eq!(bytes, b"0123456789");
    assert!(at.len() > 1 && at.is_sorted() && at[0] == MS, "{at:?}");
    assert!(at[1] > MS && at.last() <= Some(&(11 * MS)), "{at:?}");
}

#[test]
fn a_send_may_pause_once_within() {
    let faults = Faults { stall: 1.0, latency: Duration::ZERO, ..Faults::NONE };
    let mut longest = Duration::ZERO;
    for seed in 0..200 {
        let mut link = Link::new(seed, faults);
        link.send(End::A, Duration::ZERO, b"0123456789");
        let Some(Delivery::Bytes(mut bytes)) = link.receive(End::B, Duration::ZERO) else { panic!() };
        let at = link.next_delivery().unwrap();
        assert!((MS..=10_000 * MS).contains(&at) && !bytes.is_empty(), "{at:?}");
        let Some(Delivery::Bytes(rest)) = link.receive(End::B, at) else { panic!() };
        bytes.extend(rest);
        assert_eq!((&bytes[..], link.counts().stalls), (&b"0123456789"[..], 1));
        longest = longest.max(at);
    }
    assert!(longest > 5000 * MS, "{longest:?}");
}

#[test]
fn a_healed_link_commits_nothing_more() {
    let mut link = Link::new(6, Faults { disconnect: 1.0, ..Faults::SERIAL }.at_baud(9600));
    link.heal();
    link.send(End::A, Duration::ZERO, &[0; 960]);
    assert_eq!(link.counts(), FaultCounts::default());
    assert!(link.next_delivery() > Some(999 * MS), "the line is as slow as before");
}

#[test]
fn a_break_keeps_a_beginning_and_both_ends_learn_of_it() {
    let mut link = Link::new(2, Faults { disconnect: 1.0, ..Faults::NONE });
    link.send(End::A, MS, b"0123456789");
    assert!(!link.is_connected());
    let (bytes, _, closed) = drain(&mut link, End::B);
    assert!(closed && b"0123456789".starts_with(&bytes));
    assert_eq!(drain(&mut link, End::A), (vec![], vec![], true));
    link.send(End::A, MS, b"lost");
    link.reconnect();
    assert_eq!(link.next_delivery(), None);
}

#[test]
fn a_serial_line_corrupts_as_often_as_its_settings_say() {
    let mut link = Link::new(3, Faults { flip: 0.01, ..Faults::NONE });
    let sent = vec![0u8; 100_000];
    link.send(End::B, MS, &sent);
    let (bytes, _, _) = drain(&mut link, End::A);
    let wrong = bytes.iter().filter(|b| b.count_ones() == 1).count() as u64;
    assert_eq!(wrong, link.counts().flips);
    assert!((800..1200).contains(&wrong), "{wrong}");
}

#[test]
fn each_byte_takes_ten_bits_at_the_baud_rate() {
    let mut link = Link::new(4, Faults { latency: Duration::ZERO, ..Faults::NONE }.at_baud(9600));
    link.send(End::A, Duration::ZERO, &[0; 96]);
    assert_eq!(link.next_delivery().unwrap().as_micros(), 99_999);
    link.send(End::A, Duration::ZERO, &[0; 96]);
    link.receive(End::B, Duration::MAX);
    assert_eq!(link.next_delivery().unwrap().as_micros(), 199_999);
}

#[test]
fn datagrams_repeat_and_overtake_but_keep_their_borders() {
    let faults = Faults { delay: 0.5, repeat: 0.2, lose: 0.1, ..Faults::UDP };
    let mut link = Link::new(5, faults);
    for i in 0..100u8 {
        link.send(End::A, MS * u32::from(i), &[i, i]);
    }
    let mut seen = Vec::new();
    while let Some(Delivery::Bytes(d)) = link.receive(End::B, Duration::MAX) {
        assert!(d.len() == 2 && d[0] == d[1]);
        seen.push(d[0]);
    }
    assert!(seen.windows(2).any(|w| w[0] > w[1]), "none overtook");
    let counts = link.counts();
    assert_eq!(seen.len() as u64, 100 - counts.losses + counts.repeats);
}

#[test]
fn the_same_seed_commits_the_same_faults() {
    let run = |seed| {
        let mut link = Link::new(seed, Faults::SERIAL);
        for _ in 0..50 {
            link.send(End::A, MS, b"the same bytes every time");
        }
        (drain(&mut link, End::B), link.counts())
    };
    assert_eq!(run(9), run(9));
    assert_ne!(run(9), run(10));
}
