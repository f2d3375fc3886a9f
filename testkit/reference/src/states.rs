//! `reference/states/<link>.json`: every cell of every machine, from the rows in testkit.

use anyhow::Result;
use testkit::links;
use testkit::model::{Cell, cells};

use crate::json::{self, Object};

/// The crate of the operator's latch, which is no link, and has states alone.
pub(crate) const LATCH: &str = "cellwire-motion";

/// Every cell of a link.
pub(crate) fn table(link: &str) -> Vec<Cell> {
    match link {
        "isra-ball" => {
            [cells::<links::isra_ball::rows::Host>(), cells::<links::isra_ball::rows::Ball>()].concat()
        }
        "val2-viewer" => {
            [cells::<links::val2_viewer::rows::Host>(), cells::<links::val2_viewer::rows::Workstation>()]
                .concat()
        }
        "kawasaki-msg" => {
            [cells::<links::kawasaki_msg::rows::Pc>(), cells::<links::kawasaki_msg::rows::Robot>()].concat()
        }
        "val2-alter" => {
            [cells::<links::val2_alter::rows::Host>(), cells::<links::val2_alter::rows::Controller>()]
                .concat()
        }
        "laser-eb90" => {
            [cells::<links::laser_eb90::rows::Host>(), cells::<links::laser_eb90::rows::Controller>()]
                .concat()
        }
        "fanuc-hmi-modbus" => {
            use links::fanuc_hmi_modbus::rows::{Client, Rtu, RtuOverTcp, Server, Tcp};
            [
                cells::<Client<Tcp>>(),
                cells::<Client<Rtu>>(),
                cells::<Client<RtuOverTcp>>(),
                cells::<Server<Tcp>>(),
                cells::<Server<Rtu>>(),
                cells::<Server<RtuOverTcp>>(),
            ]
            .concat()
        }
        "mmacell-proto" => {
            use links::mmacell_proto::rows::{Central, Device, Moved, Progress};
            [cells::<Central>(), cells::<Progress>(), cells::<Device>(), cells::<Moved>()].concat()
        }
        LATCH => cells::<links::latch::rows::Operator>(),
        _ => Vec::new(),
    }
}

/// The text of a link's file.
pub(crate) fn file(link: &str) -> Result<String> {
    let mut lines = Vec::new();
    for Cell { end, state, input, to, action } in table(link) {
        let object = Object::new().value("machine", end)?.value("state", &state)?.value("input", &input)?;
        let object = match &to {
            None => object.raw("unexpected", true),
            Some(to) => object.value("to", to)?,
        };
        lines.push(object.optional("actions", (!action.is_empty()).then_some(&action))?.end());
    }
    Ok(json::file("states.schema.json", &[("link", json::text(link)?)], "cells", &lines))
}
