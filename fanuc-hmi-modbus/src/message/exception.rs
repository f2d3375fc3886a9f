use core::fmt;

/// The reason that a server refuses a request: the exception code (section 7 of the specification).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(from = "u8", into = "u8"))]
#[non_exhaustive]
pub enum Exception {
    /// 1: the server does not support the function.
    IllegalFunction,
    /// 2: an address, or address and quantity together, lie outside the server's tables.
    IllegalDataAddress,
    /// 3: a quantity, a length or a value that the function does not allow.
    IllegalDataValue,
    /// 4: the server failed while it executed the request.
    ServerDeviceFailure,
    /// 5: accepted, but it takes long.
    Acknowledge,
    /// 6: busy with a long command; ask again later.
    ServerDeviceBusy,
    /// 8: extended memory failed its parity check.
    MemoryParityError,
    /// 10: a gateway found no path to the unit.
    GatewayPathUnavailable,
    /// 11: the unit beyond a gateway did not answer.
    GatewayTargetFailedToRespond,
    /// A code that the specification does not name.
    Other(u8),
}

impl From<u8> for Exception {
    fn from(code: u8) -> Self {
        match code {
            1 => Self::IllegalFunction,
            2 => Self::IllegalDataAddress,
            3 => Self::IllegalDataValue,
            4 => Self::ServerDeviceFailure,
            5 => Self::Acknowledge,
            6 => Self::ServerDeviceBusy,
            8 => Self::MemoryParityError,
            0x0A => Self::GatewayPathUnavailable,
            0x0B => Self::GatewayTargetFailedToRespond,
            other => Self::Other(other),
        }
    }
}

impl From<Exception> for u8 {
    fn from(exception: Exception) -> Self {
        match exception {
            Exception::IllegalFunction => 1,
            Exception::IllegalDataAddress => 2,
            Exception::IllegalDataValue => 3,
            Exception::ServerDeviceFailure => 4,
            Exception::Acknowledge => 5,
            Exception::ServerDeviceBusy => 6,
            Exception::MemoryParityError => 8,
            Exception::GatewayPathUnavailable => 0x0A,
            Exception::GatewayTargetFailedToRespond => 0x0B,
            Exception::Other(code) => code,
        }
    }
}

impl fmt::Display for Exception {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match self {
            Self::IllegalFunction => "illegal function",
            Self::IllegalDataAddress => "illegal data address",
            Self::IllegalDataValue => "illegal data value",
            Self::ServerDeviceFailure => "server device failure",
            Self::Acknowledge => "acknowledge",
            Self::ServerDeviceBusy => "server device busy",
            Self::MemoryParityError => "memory parity error",
            Self::GatewayPathUnavailable => "gateway path unavailable",
            Self::GatewayTargetFailedToRespond => "gateway target device failed to respond",
            Self::Other(_) => "unknown",
        };
        write!(f, "exception {} ({name})", u8::from(*self))
    }
}

impl core::error::Error for Exception {}

#[cfg(test)]
mod tests {
    use super::Exception;

    #[test]
    fn every_code_is_kept() {
        for code in 0..=255 {
            assert_eq!(u8::from(Exception::from(code)), code);
        }
    }
}
