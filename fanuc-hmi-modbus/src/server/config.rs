use crate::framing::Framing;
use crate::model::Rule;
use crate::timing;

/// How a server is reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ServerConfig {
    /// The transport. [`Framing::Tcp`].
    pub framing: Framing,
    /// The unit that it is, 1 to 247 (0 and 255 too on TCP): requests to others are not carried out. `None`, the default, answers
    /// every unit with its own identifier, as most Modbus TCP servers do.
    pub unit: Option<u8>,
    /// Whether unit 0 is a broadcast: carried out, never answered. Off on TCP, where 0 is often the server itself; on for RTU.
    pub broadcast: bool,
    /// For the model only: the rule that the machine does not keep.
    #[cfg(feature = "model")]
    #[doc(hidden)]
    pub without: Option<Rule>,
}

impl ServerConfig {
    /// Modbus TCP: every unit is answered.
    pub const fn tcp() -> Self {
        Self {
            framing: Framing::Tcp,
            unit: None,
            broadcast: false,
            #[cfg(feature = "model")]
            without: None,
        }
    }

    /// RTU on a serial line.
    pub const fn rtu(unit: u8, baud: u32) -> Self {
        let framing = Framing::Rtu { silence: timing::silence(baud) };
        Self::on_line(framing, unit)
    }

    /// RTU frames through a TCP connection.
    pub const fn rtu_over_tcp(unit: u8) -> Self {
        Self::on_line(Framing::RTU_OVER_TCP, unit)
    }

    const fn on_line(framing: Framing, unit: u8) -> Self {
        let mut config = Self::tcp();
        config.framing = framing;
        config.unit = Some(unit);
        config.broadcast = true;
        config
    }
}

impl ServerConfig {
    /// Whether a request to this unit is a broadcast.
    pub const fn is_broadcast(&self, unit: u8) -> bool {
        self.broadcast && unit == 0
    }

    /// Whether the machine keeps a rule: always, but in the model.
    pub(crate) fn keeps(&self, _rule: Rule) -> bool {
        #[cfg(feature = "model")]
        return self.without != Some(_rule);
        #[cfg(not(feature = "model"))]
        true
    }
}

impl Default for ServerConfig {
    fn default() -> Self {
        Self::tcp()
    }
}
