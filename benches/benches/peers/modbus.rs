//! Modbus TCP against other crates: the work whose instructions `budgets` counts.

#[path = "../work/modbus.rs"]
mod work;

use crate::race::race;

/// The common conditions of these races, and the differences.
const NOTES: &str = "\
The same work: all read and write bytes in memory, check every length, and have the registers in an array.
The codec of tokio-modbus is private: it is measured through its client, which polls a future. modbus-core does not
serve registers itself: the bench contains the code for that.
";

pub(crate) fn races() {
    race(
        "decode a reply of 38 registers, copy them",
        [
            ("fanuc-hmi-modbus", work::decode),
            ("modbus-core 0.2", work::decode_modbus_core),
            ("rmodbus 0.13", work::decode_rmodbus),
        ],
    );
    race(
        "serve a read of 38 registers",
        [
            ("fanuc-hmi-modbus", work::serve),
            ("– its server session", work::server_session),
            ("modbus-core 0.2, copying by hand", work::serve_modbus_core),
            ("rmodbus 0.13", work::serve_rmodbus),
        ],
    );
    race(
        "encode the request",
        [
            ("fanuc-hmi-modbus", work::encode),
            ("modbus-core 0.2", work::encode_modbus_core),
            ("rmodbus 0.13", work::encode_rmodbus),
        ],
    );
    race(
        "request, transmit, receive, copy 38 registers",
        [
            ("fanuc-hmi-modbus, the client session", work::exchange),
            ("tokio-modbus 0.17, over a transport in memory", work::exchange_tokio_modbus),
        ],
    );
    println!("{NOTES}");
}
