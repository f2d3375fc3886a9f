//! The settings of codec and client in the tool.

use crate::settings::{self, Configure, FieldVisitor, Setting};
use fanuc_hmi_modbus::{ClientConfig, Framing, WordOrder};

/// The frames of a connection.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Frames {
    /// Modbus TCP: frames with MBAP headers.
    #[default]
    Tcp,
    /// RTU over TCP: frames as on a serial line, through a TCP connection.
    Rtu,
}

/// The settings of a view of the link's bytes, and the registers that a client requests.
#[derive(Debug, Clone, Copy, Default)]
pub struct ViewSettings {
    /// The frames of the connection.
    pub frames: Frames,
    /// Whether a reply of 37 registers is shown as the telemetry block.
    pub telemetry: bool,
    /// The order of the words of wide values.
    pub word_order: WordOrder,
    /// The unit to which a client sends requests; `None`: the command's own default. The bytes of every unit are shown.
    pub unit: Option<u8>,
    /// The PDU address of the first register that a client requests; `None`: the command's own default. Every register is
    /// shown.
    pub address: Option<u16>,
}

impl ViewSettings {
    /// Returns the framing of a stream without times.
    pub fn framing(&self) -> Framing {
        match self.frames {
            Frames::Tcp => Framing::Tcp,
            Frames::Rtu => Framing::RTU_OVER_TCP,
        }
    }
}

impl Configure for ViewSettings {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        let Self { frames, telemetry, word_order, unit, address } = self;
        self::frames(fields, frames);
        let about = "show a reply of 37 registers as the telemetry block";
        fields.choice("view", &[("registers", false), ("telemetry", true)], about, telemetry);
        self::word_order(fields, word_order);
        let about = "the unit that a client asks, 1 by default; decode shows every unit";
        fields.whole_or("unit", 0..=u8::MAX, "", "auto", about, unit);
        let about =
            "the PDU address of the first register that a client asks for; decode shows every register";
        fields.whole_or("address", 0..=u16::MAX, "", "auto", about, address);
    }
}

/// A client of the tool: the kind of connection decides the framing, and there is one request at a time.
#[derive(Debug)]
pub struct ClientSettings<'a>(pub &'a mut ClientConfig);

impl Configure for ClientSettings<'_> {
    fn configure(&mut self, fields: &mut impl FieldVisitor) {
        fields.without(&["framing", "in_flight"], |fields| self.0.configure(fields));
    }
}

/// Returns the settings of a client, on every kind of port.
pub fn client_settings() -> Vec<Setting> {
    client_settings_of([ClientConfig::tcp(), ClientConfig::rtu(19_200), ClientConfig::rtu_over_tcp()])
}

/// Returns the settings of clients that begin with these configurations, each name once.
pub fn client_settings_of(configs: impl IntoIterator<Item = ClientConfig>) -> Vec<Setting> {
    let mut settings: Vec<Setting> = Vec::new();
    for mut config in configs {
        for setting in settings::list(ClientSettings(&mut config)) {
            if settings.iter().all(|known| known.name != setting.name) {
                settings.push(setting);
            }
        }
    }
    settings
}

/// Visits the setting `framing`.
pub fn frames(fields: &mut impl FieldVisitor, frames: &mut Frames) {
    let about = "with MBAP headers, or as on a serial line";
    fields.choice("framing", &[("tcp", Frames::Tcp), ("rtu", Frames::Rtu)], about, frames);
}

/// Visits the setting `word_order`.
pub fn word_order(fields: &mut impl FieldVisitor, order: &mut WordOrder) {
    let choices = [("low_first", WordOrder::LowFirst), ("high_first", WordOrder::HighFirst)];
    fields.choice("word_order", &choices, "which register of a 32-bit value comes first", order);
}
