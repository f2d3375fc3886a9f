//! `cellwire simulate kawasaki-pc` and `kawasaki-robot`: an end to test the other one against.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::mpsc;

use anyhow::Result;
use cellwire_sim::{Device, KawasakiPc, Settings as _, Simulator, SimulatorReport};
use kawasaki_msg::{Charset, Decimal, Dialect, Job, PcConfig, PcEvent, RobotEvent, Takeover};
use serde_json::{Map, Value, json};

use super::control;
use super::endpoint::{self, Connection, Report};
use super::options::{PcSettings, RobotSettings};
use super::peer_endpoint::{PeerEndpoint, Side};
use super::robot::{self, Setup, Stroke};
use super::sheet::{Lines, SHEET};
use crate::devices::control::OwnCommands;
use crate::devices::device::SimulateOptions;
use crate::devices::host::connected;
use crate::io::drawing::{self, Picture};
use crate::io::table::AppendedTable;
use cellwire_io::clock::Clock;
use cellwire_io::output::{log, notice, remark};
use cellwire_io::trace::Trace;
use cellwire_links::kawasaki_msg::layout::{AnyValue, AnyWork, Field, FieldType, Layout};
use cellwire_links::kawasaki_msg::plant::Plant;
use cellwire_links::settings::{self, RefusedSetting};

/// Runs the PC until interrupted: a robot that connects gets the picture as an order, or example jobs if the plant's jobs
/// are not lines.
///
/// # Errors
/// If the endpoint cannot be opened, or a setting is not one of this device's.
pub fn pc(options: &SimulateOptions) -> Result<()> {
    let settings = settings::read("kawasaki-pc", PcSettings::default(), &options.settings)?;
    let layout = settings.plant.layout()?;
    let jobs = match (settings.drawing(), Lines::of(&layout)) {
        (Some(file), lines) => lines?.jobs(&Picture::from_file(&file, SHEET, false)?),
        (None, Ok(lines)) => lines.jobs(&Picture::built_in(SHEET)?),
        (None, Err(why)) => {
            remark(&format!("{why:#}: an order is {EXAMPLES} jobs with example values of its fields"));
            examples(&layout, settings.config.dialect.charset())?
        }
    }
    .into();
    let config = pc_config(&settings.plant, settings.config, &options.settings)?;
    let PcSettings { order, repeat, .. } = settings;
    let mut pc = KawasakiPc { config, ranges: layout, order, jobs, repeat }.simulator()?.keeping_nothing();
    let (name, udp) = ("kawasaki-pc", config.datagrams.then_some(config.dialect));
    let (mut meeting, trace) = open(Side::Pc, name, options, udp, &mut pc, control::pc())?;
    let clock = Clock::start();
    endpoint::run(
        Side::Pc,
        &mut meeting,
        &trace,
        clock,
        &mut pc,
        || true,
        |_, report| match report {
            Report::Event(SimulatorReport::Device(event)) => {
                let print = match event {
                    PcEvent::PeerStatus { .. } | PcEvent::Corrupt(_) | PcEvent::Rejected(_) => notice,
                    _ => log,
                };
                print(&serde_json::to_value(event)?)
            }
            Report::Connection(change) => print(change),
            _ => Ok(()),
        },
    )?;
    Ok(())
}

/// Opens the endpoint of an end, and reports the end as ready; returns its endpoint and its trace.
fn open<D: Device + 'static>(
    side: Side,
    name: &'static str,
    options: &SimulateOptions,
    udp: Option<Dialect>,
    simulator: &mut Simulator<D>,
    own: OwnCommands<D>,
) -> Result<(PeerEndpoint, Trace)> {
    let (meeting, kind, place) =
        PeerEndpoint::open(side, &options.endpoint, udp, options.dialing, &options.tls)?;
    options.ready(name, kind, &place, simulator, own)?;
    Ok((meeting, options.trace.start(name)))
}

/// Returns a PC's configuration in a plant. If the plant lacks a message that interrupts an order, as a drafted plant may,
/// and `given` lacks `takeover`, the robot's earlier order is ended.
///
/// # Errors
/// If it cannot work.
pub fn pc_config(plant: &Plant, config: PcConfig, given: &Map<String, Value>) -> Result<PcConfig> {
    let lacks_interrupt = |error: &RefusedSetting| error.name == "messages.order_interrupt";
    match plant.pc(config) {
        Err(error)
            if error.downcast_ref().is_some_and(lacks_interrupt) && !given.contains_key("takeover") =>
        {
            remark(
                "the plant's settings have no message that interrupts an order (messages.order_interrupt): if the robot still has an order, it is \
                 ended after the queued jobs (takeover=end)",
            );
            plant.pc(PcConfig { takeover: Takeover::End, ..config })
        }
        config => config,
    }
}

/// The jobs of an order whose jobs are not lines.
const EXAMPLES: usize = 10;

/// Jobs of any layout: fields have their defaults, other numbers count upwards within their range, other texts are as short
/// as they may be.
fn examples(layout: &Layout, charset: Charset) -> Result<Vec<AnyWork>> {
    let job = |at: usize| {
        let value = |field: &Field| match (field.default, field.holds) {
            (Some(AnyValue::Text(text)), _) => text.to_string(),
            (Some(AnyValue::Number(units)), FieldType::Number { places, .. }) => {
                Decimal { units, places }.to_string()
            }
            (_, FieldType::Number { places, min, max }) => {
                let steps = i64::from(max) - i64::from(min) + 1;
                let first = 0.clamp(min, max);
                let from_min = i64::from(first) - i64::from(min) + i64::try_from(at).unwrap_or_default();
                let units = i32::try_from(i64::from(min) + from_min % steps).unwrap_or(first);
                Decimal { units, places }.to_string()
            }
            (_, FieldType::Text { min, max }) => "A".repeat(min.max(1).min(max)),
        };
        let texts: Vec<String> = layout.fields().iter().map(value).collect();
        let texts: Vec<&str> = texts.iter().map(String::as_str).collect();
        Ok(layout.job(&texts, charset)?)
    };
    (0..EXAMPLES).map(job).collect()
}

/// Runs the robot until interrupted.
///
/// # Errors
/// If a setting is not one of this device's.
pub fn robot(options: &SimulateOptions) -> Result<()> {
    let RobotSettings { plant, config, queue, speed, job_time, out, record } =
        settings::read("kawasaki-robot", RobotSettings::default(), &options.settings)?;
    let (config, layout) = (plant.robot(config)?, plant.layout()?);
    let lines = Lines::of(&layout).ok();
    let names = ["order", "number"].into_iter().chain(layout.fields().iter().map(|field| &*field.name));
    let names: Vec<&str> = names.collect();
    let open_record = |file: String| AppendedTable::open(Path::new(&file), "jobs", &names);
    let mut record = record.map(open_record).transpose()?;
    let (out, speed) = (out.map(PathBuf::from), f64::from(speed));
    let mut simulator = robot::simulator(&Setup { config, layout: layout.clone(), queue, speed, job_time })?;
    let (name, udp) = ("kawasaki-robot", config.datagrams.then_some(config.dialect));
    let own = control::robot(layout.clone());
    let (mut meeting, trace) = open(Side::Robot, name, options, udp, &mut simulator, own)?;
    let (sender, strokes) = mpsc::channel::<Stroke>();
    // All orders are drawn on one sheet; the lines of the last one begin here.
    let (mut sheet, mut begin): (Vec<drawing::Line>, usize) = (Vec::new(), 0);
    let executed = |stroke: Stroke| {
        if let Some(record) = &mut record {
            let Job { order, number, work, .. } = &stroke.job;
            let fields = (0..layout.fields().len()).map(|place| layout.show(place, work));
            record.add([order, number].map(|number| number.to_string()).into_iter().chain(fields));
        }
        let _ = sender.send(stroke);
    };
    robot::run(simulator, &mut meeting, &trace, &AtomicBool::new(false), executed, |report| match report {
        Report::Event(event) => {
            let executed = strokes.try_iter();
            sheet.extend(executed.filter_map(|stroke| Some(lines.as_ref()?.line(&stroke.job.work))));
            if let (RobotEvent::OrderOver { .. }, Some(_)) = (event, &lines) {
                let strokes = sheet.iter().skip(begin).filter(|line| line.draws).count();
                begin = sheet.len();
                log(&json!({"event": "drawn", "strokes": strokes}))?;
                if let Some(file) = &out {
                    drawing::write_svg(file, SHEET, &sheet)?;
                }
            }
            let print = match event {
                RobotEvent::PeerStatus { .. }
                | RobotEvent::NoReply
                | RobotEvent::Corrupt(_)
                | RobotEvent::Rejected(_) => notice,
                _ => log,
            };
            print(&serde_json::to_value(event)?)
        }
        Report::Connection(change) => print(change),
        _ => Ok(()),
    })?;
    Ok(())
}

fn print(change: Connection<'_>) -> Result<()> {
    match change {
        Connection::Connected(peer) => connected(peer),
        Connection::Disconnected(why) => notice(&json!({"event": "disconnected", "why": why})),
        Connection::Traced(path) => log(&json!({"event": "trace", "path": path})),
    }
}
