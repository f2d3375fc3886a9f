use std::hint::black_box;

use benches::{Budget, Count, Link};
use val2_viewer::robot_session::{Decoder as _, Encode as _};
use val2_viewer::{Decoder, PosePacket, timing};

use crate::streams;

const LINE: &[u8] = b"$POSE,7,16384,0,0,0,-16384,0,0,0,-16384,12800,-4816,16*30\r\n";

pub const LINK: Link = Link {
    name: "val2-viewer",
    counts: &[
        Count { what: "decode a pose", goal: None, units: 1.0, unit: "op", run: decode },
        Count { what: "decode a pose from the stream", goal: None, units: 1.0, unit: "op", run: stream },
        Count { what: "encode a pose", goal: None, units: 1.0, unit: "op", run: encode },
        streams::valid(LINE.len() as f64, |rounds| streams::push(rounds, Decoder::new(), LINE, 1)),
        streams::noisy(streams::RANDOM_WHOLE, |rounds| {
            streams::push_whole(rounds, Decoder::new(), &streams::noise())
        }),
        streams::noisy_bytes(streams::RANDOM, |rounds| {
            streams::push_noise(rounds, Decoder::new(), &streams::noise())
        }),
        streams::noisy(streams::WORST_WHOLE, |rounds| {
            streams::push_whole(rounds, Decoder::new(), &streams::repeated(b"$"))
        }),
        streams::noisy_bytes(streams::WORST, |rounds| {
            streams::push_noise(rounds, Decoder::new(), &streams::repeated(b"$"))
        }),
        streams::LIMIT,
    ],
    ratios: streams::RATIOS,
    budgets,
};

fn decode(rounds: u64) {
    for _ in 0..rounds {
        let Ok(Some(packet)) = PosePacket::decode(black_box(LINE)) else { panic!("a good line") };
        black_box(packet);
    }
}

fn stream(rounds: u64) {
    let mut decoder = Decoder::new();
    for _ in 0..rounds {
        assert_eq!(decoder.push(black_box(LINE)), LINE.len());
        black_box(decoder.next_frame().expect("a whole line").expect("a good line"));
    }
}

fn encode(rounds: u64) {
    let (packet, _) = PosePacket::decode(LINE).expect("good").expect("whole");
    let mut out = [0; PosePacket::MAX_LEN];
    for _ in 0..rounds {
        black_box(&packet).encode(black_box(&mut out)).expect("it fits");
    }
}

fn budgets() -> Vec<Budget> {
    vec![Budget {
        what: "ENQ and the longest pose at 19200 baud, in a display cycle".into(),
        takes: timing::exchange_time(timing::BAUD),
        window: timing::CYCLE,
        source: "§5",
    }]
}
