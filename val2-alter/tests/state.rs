//! The tables of both state machines, printed and compared with the ones committed.
#![allow(clippy::unwrap_used)]

use val2_alter::state::{ControllerInput, HostInput};
use val2_alter::{ControllerState, HostState};

#[test]
fn every_state_and_input_is_defined() {
    let mut matrix = String::new();
    for state in HostState::ALL {
        for input in HostInput::ALL {
            matrix += &format!("host        {state:?} + {input:?} = {:?}\n", state.on(input));
        }
    }
    for state in ControllerState::ALL {
        for input in ControllerInput::ALL {
            matrix += &format!("controller  {state:?} + {input:?} = {:?}\n", state.on(input));
        }
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/state_matrix.txt");
    if std::env::var_os("BLESS").is_some() {
        std::fs::write(path, &matrix).unwrap();
    }
    assert_eq!(matrix, std::fs::read_to_string(path).unwrap());
}
