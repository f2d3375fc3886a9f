//! The echo of a line is found however its bytes arrive.

use robot_session::EchoError;
use robot_session::end::Echo;

const SENT: [u8; 6] = [1, 1, 2, 1, 1, 3];

/// Returns the remaining bytes, and the first error, of bytes that come in two pieces.
fn receive(come: &[u8], cut: usize) -> (Vec<u8>, Option<EchoError>) {
    let mut echo = Echo::<8>::new(false);
    echo.sent(&SENT, true);
    let (first, second) = come.split_at(cut);
    let (first, error) = echo.receive(first);
    let (first, error) = (first.to_vec(), error);
    let (second, later) = echo.receive(second);
    // The bytes that came before the echo was found were passed on, as they could have been an answer.
    (
        if error.is_none() && later.is_some() { second.to_vec() } else { [&first, second].concat() },
        error.or(later),
    )
}

#[test]
fn it_is_found_behind_two_bytes_of_noise_in_any_two_pieces() {
    for noise in [&[][..], &[9], &[1], &[9, 9], &[1, 1], &[1, 9]] {
        let come = [noise, &SENT, &[7, 7]].concat();
        for cut in 0..=come.len() {
            let found = receive(&come, cut);
            assert_eq!(
                found,
                (vec![7, 7], Some(EchoError::NotSet { length: SENT.len() })),
                "{come:?} cut at {cut}"
            );
        }
    }
}

#[test]
fn an_answer_that_begins_like_it_is_passed_on_whole_in_any_two_pieces() {
    let longer = [9, 9, 9, 1, 1, 2, 1, 1, 3];
    for come in [&[1, 1, 2, 1, 1, 4, 3][..], &[1, 1, 2, 1, 1], &[1, 1, 1, 1, 2, 1, 1, 4], &longer] {
        for cut in 0..=come.len() {
            assert_eq!(receive(come, cut), (come.to_vec(), None), "{come:?} cut at {cut}");
        }
    }
}
