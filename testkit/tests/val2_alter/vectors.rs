//! Every vector of `reference/vectors/val2-alter.json`: whole, in pieces, glued to its neighbour, behind a cut frame.
use robot_session::Decoder as _;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use testkit::chunking::{after_a_cut, chunkings};
use testkit::vectors::{Outcome, Vector, includes, vectors};
use val2_alter::{DecodeError, Decoder, Frame, Framing, HostMessage, Message, Received, RobotMessage};

type Outcomes<M> = Vec<Result<Received<M>, DecodeError>>;

fn framing(vector: &Vector) -> Framing {
    serde_json::from_value(Value::Object(vector.options.clone())).unwrap()
}

/// Everything that a stream gives, read in these pieces, after which the line falls silent.
fn read<M: Message>(framing: Framing, pieces: &[&[u8]]) -> Outcomes<M> {
    let mut decoder = Decoder::new(framing);
    let mut all = Vec::new();
    for piece in pieces {
        let mut rest = *piece;
        while !rest.is_empty() {
            let taken = decoder.push(rest);
            rest = &rest[taken..];
            while let Some(outcome) = decoder.next_frame() {
                all.push(outcome);
            }
        }
    }
    decoder.finish();
    while let Some(outcome) = decoder.next_frame() {
        all.push(outcome);
    }
    assert_eq!(decoder.pending(), 0);
    all
}

fn messages<M: Message>(outcomes: &Outcomes<M>) -> Vec<M> {
    outcomes.iter().filter_map(|outcome| outcome.as_ref().ok().map(|received| received.message)).collect()
}

fn check<M: Message + Serialize + DeserializeOwned>(vector: &Vector) {
    let framing = framing(vector);
    let bytes = &vector.hex;
    let whole = read::<M>(framing, &[bytes]);
    for pieces in chunkings(bytes) {
        assert_eq!(read::<M>(framing, &pieces), whole, "vector {}, cut into {pieces:02X?}", vector.id);
    }
    match vector.result {
        Outcome::Valid | Outcome::Acceptable => {
            let [Ok(Received { offset: 0, length, message })] = whole[..] else {
                panic!("vector {}: {whole:?}", vector.id)
            };
            assert_eq!(length, bytes.len(), "vector {}", vector.id);
            let object = vector.message.clone().unwrap();
            assert_eq!(serde_json::to_value(message).unwrap(), object, "vector {}", vector.id);
            assert_eq!(serde_json::from_value::<M>(object).unwrap(), message, "vector {}", vector.id);
            let mut out = [0; Frame::MAX_LEN];
            let written = message.encode(framing, &mut out).unwrap();
            assert_eq!(written, message.encoded_len(framing));
            assert_eq!(out[..written] == bytes[..], vector.result == Outcome::Valid, "vector {}", vector.id);
        }
        Outcome::Invalid => {
            let [Err(error)] = whole[..] else { panic!("vector {}: {whole:?}", vector.id) };
            let found = serde_json::to_value(error).unwrap();
            let wanted = vector.error.as_ref().unwrap();
            assert!(includes(&found, wanted), "vector {}: {found} is not {wanted}", vector.id);
        }
    }
}

fn from<'a>(all: &'a [Vector], side: &'a str) -> impl Iterator<Item = &'a Vector> + Clone {
    all.iter().filter(move |vector| vector.from.as_deref() == Some(side))
}

#[test]
fn each_vector_alone() {
    let all = vectors("val2-alter");
    from(&all, "robot").for_each(check::<RobotMessage>);
    from(&all, "host").for_each(check::<HostMessage>);
    assert_eq!(from(&all, "robot").count() + from(&all, "host").count(), all.len());
}

fn check_neighbours<M: Message>(all: &[Vector], side: &str) {
    // Bytes behind a frame that is not whole belong to it.
    let is_whole = |vector: &&Vector| vector.error.as_ref().is_none_or(|error| error["kind"] != "incomplete");
    for first in from(all, side).filter(is_whole) {
        for second in from(all, side).filter(|second| second.options == first.options) {
            let framing = framing(first);
            let mut apart = messages(&read::<M>(framing, &[&first.hex]));
            apart.extend(messages(&read::<M>(framing, &[&second.hex])));
            // A frame that breaks off takes what follows for its data, until the checksum tells.
            let glued = read::<M>(framing, &[&first.hex, &second.hex]);
            let plausible = apart.iter().all(Message::is_plausible);
            let whole = first.result != Outcome::Invalid;
            if plausible || whole {
                assert_eq!(messages(&glued), apart, "vectors {} and {}", first.id, second.id);
            }
            let good = whole && second.result != Outcome::Invalid;
            assert_eq!(good, glued.iter().all(Result::is_ok), "vectors {} and {}", first.id, second.id);
        }
    }
}

#[test]
fn each_vector_behind_each() {
    let all = vectors("val2-alter");
    check_neighbours::<RobotMessage>(&all, "robot");
    check_neighbours::<HostMessage>(&all, "host");
}

fn check_behind_a_cut<M: Message>(all: &[Vector], side: &str) -> usize {
    let valid = from(all, side).filter(|vector| vector.result == Outcome::Valid);
    let mut count = 0;
    for corrupt in valid.clone() {
        for good in valid.clone().filter(|good| good.options == corrupt.options) {
            let framing = framing(good);
            let [message] = messages(&read::<M>(framing, &[&good.hex]))[..] else { panic!() };
            if !message.is_plausible() {
                continue;
            }
            for stream in after_a_cut(&corrupt.hex, &good.hex) {
                let got = messages(&read::<M>(framing, &[&stream]));
                assert_eq!(got.last(), Some(&message), "{} cut, then {}: {stream:02X?}", corrupt.id, good.id);
                count += 1;
            }
        }
    }
    count
}

#[test]
fn each_vector_behind_each_cut_anywhere() {
    let all = vectors("val2-alter");
    let count =
        check_behind_a_cut::<RobotMessage>(&all, "robot") + check_behind_a_cut::<HostMessage>(&all, "host");
    assert!(count > 5000, "{count}");
}

#[test]
fn offsets_count_through_the_stream() {
    let all = vectors("val2-alter");
    let good = &all.iter().find(|vector| vector.id == 15).unwrap().hex;
    let stream = [&good[..], good, b"noise", good, b"\x10\x10", good].concat();
    let outcomes = read::<RobotMessage>(Framing::DEFAULT, &[&stream]);
    let places: Vec<_> = outcomes.iter().map(|o| o.map(|r| r.offset)).collect();
    let noise = DecodeError::StartMark { offset: 24, length: 5 };
    // DLEs before a start mark belong to its frame.
    assert_eq!(places, [Ok(0), Ok(12), Err(noise), Ok(29), Ok(41)]);
}
