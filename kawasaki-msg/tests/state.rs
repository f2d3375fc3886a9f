//! The tables of both state machines, printed and compared with the ones committed.
#![allow(clippy::unwrap_used)]

use core::fmt::Debug;

use kawasaki_msg::state::{Link, LinkEvent, OrderEvent, Phase};

fn matrix<S: Copy + Debug, E: Copy + Debug>(
    states: &[S],
    events: &[E],
    on: impl Fn(S, E) -> Option<S>,
) -> String {
    let mut text = String::new();
    for state in states {
        for event in events {
            let next = on(*state, *event).map_or("-".into(), |next| format!("{next:?}"));
            text += &format!("{state:?} + {event:?} -> {next}\n");
        }
    }
    text
}

#[test]
fn every_state_and_event_is_in_the_table() {
    let links = matrix(&Link::ALL, &LinkEvent::ALL, Link::on);
    let phases = matrix(&Phase::ALL, &OrderEvent::ALL, Phase::on);
    assert_eq!(links + &phases, include_str!("state_matrix.txt"));
}

#[test]
fn no_session_is_ever_in_an_unknown_phase() {
    for event in OrderEvent::ALL {
        assert_eq!(Phase::Other(9).on(event), None);
        assert!(Phase::ALL.iter().all(|phase| !matches!(phase.on(event), Some(Phase::Other(_)))));
    }
}

#[test]
fn every_code_of_a_phase_survives() {
    for code in 0..=u8::MAX {
        assert_eq!(u8::from(Phase::from(code)), code);
    }
}

#[test]
fn every_phase_leads_back_to_idle() {
    for phase in Phase::ALL {
        let mut reached = vec![phase];
        let mut i = 0;
        while let Some(state) = reached.get(i).copied() {
            for next in OrderEvent::ALL.iter().filter_map(|event| state.on(*event)) {
                if !reached.contains(&next) {
                    reached.push(next);
                }
            }
            i += 1;
        }
        assert!(
            reached.contains(&Phase::Idle) && reached.len() == Phase::ALL.len(),
            "{phase:?}: {reached:?}"
        );
    }
}
