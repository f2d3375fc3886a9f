//! The article's own host against our controller: it repeats a frame for each error code, and frames have no number.

use robot_session::contract::Rng;
use testkit::soak::{Article, Fault, frame};

use crate::laser_eb90::cell::MS;

/// Asserts that each of the cuts is executed once.
fn assert_once(article: &Article, cuts: u32, what: &str) {
    let mut times = vec![0; cuts as usize];
    article.executed.iter().for_each(|index| times[*index as usize] += 1);
    let wrong: Vec<_> = (0..cuts).zip(times).filter(|(_, times)| *times != 1).collect();
    assert!(wrong.is_empty(), "{what}: {} of {cuts} not once: {:?} …", wrong.len(), &wrong[..1]);
}

/// A pause before every byte of the frame but its first.
#[test]
fn a_frame_that_pauses_is_executed_once() {
    let mut frames = 0;
    for baud in [9600, 115_200] {
        for late in [0, 100, 200, 300] {
            let mut article = Article::new(baud, MS * late);
            let mut first = 0;
            for pause in [40, 51, 60, 80, 100, 150, 200, 250, 300, 350, 400] {
                for place in 1..frame(first..first + 7).len() {
                    assert!(article.exchange(first, &[&[Fault::Pause(place, MS * pause)]]));
                    first += 7;
                    frames += 1;
                }
            }
            assert_eq!(article.settle(), 0, "an unsolicited answer");
            assert_once(&article, first, &format!("{baud} baud, {late} ms late"));
        }
    }
    assert!(frames > 10_000, "{frames} frames");
}

/// The first transmission is corrupt in one byte, perhaps of its head, and all of them pause, perhaps twice. The others not
/// within the head: when it is cut there, and the rest of the frame before is in front of it, nothing shows that a frame has
/// begun.
#[test]
fn a_frame_that_is_corrupt_and_pauses_is_executed_once() {
    let (mut rng, mut transmissions) = (Rng::new(90), 0);
    for run in 0..500 {
        let baud = [9600, 115_200][run % 2];
        let mut article = Article::new(baud, MS * rng.below(300) as u32);
        for frame_index in 0..20 {
            let first = frame_index * 7;
            let length = frame(first..first + 7).len();
            let mut pauses = |from| {
                let mut pause = || Fault::Pause(from + rng.below(length - from), MS * rng.below(400) as u32);
                vec![pause(), pause()]
            };
            let (mut corrupt, again, last) = (pauses(1), pauses(3), pauses(3));
            let place = if rng.chance(0.5) { rng.below(4) } else { rng.below(length) };
            corrupt.push(Fault::Flip(place, 1 << rng.below(8)));
            assert!(article.exchange(first, &[&corrupt, &again, &last[..1]]));
        }
        assert_eq!(article.settle(), 0, "an unsolicited answer");
        assert_once(&article, 140, &format!("run {run}"));
        transmissions += article.transmissions;
    }
    assert!(transmissions > 25_000, "{transmissions} transmissions");
}
