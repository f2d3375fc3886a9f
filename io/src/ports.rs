//! The serial ports that there are, by the names under which they are opened.

use std::path::Path;

use anyhow::{Context as _, Result};
use serialport::{SerialPortInfo, SerialPortType};

/// A serial port.
#[derive(Debug, Clone, PartialEq, Eq, serde::Serialize)]
pub struct Port {
    /// The name of the port: `/dev/ttyUSB0`, `COM5`.
    pub port: String,
    /// The kind of the port: `usb`, `bluetooth`, or `built_in` for ports of the computer.
    pub kind: &'static str,
    /// The name that the adapter reports; `None` without one.
    pub adapter: Option<String>,
    /// The manufacturer that the adapter reports; `None` without one.
    pub maker: Option<String>,
    /// The serial number of the adapter: two adapters of one kind differ in it alone; `None` without one.
    pub serial_number: Option<String>,
    /// The USB numbers of maker and product, such as `0403:6001`; `None` if the port is not of USB.
    pub usb: Option<String>,
    /// The time for which the adapter's chip collects bytes, in milliseconds; `None` if the system does not report it.
    pub latency_timer_ms: Option<u32>,
}

/// Returns all ports, sorted by name, `COM5` before `COM12`.
///
/// # Errors
/// If the system does not list its ports.
pub fn list() -> Result<Vec<Port>> {
    // The library expects the folder, which is missing where no terminals are known at all.
    if cfg!(target_os = "linux") && !Path::new("/sys/class/tty").is_dir() {
        return Ok(Vec::new());
    }
    let found = serialport::available_ports().context("cannot list the serial ports")?;
    let mut ports: Vec<Port> = found.into_iter().map(of).collect();
    ports.sort_by(|one, other| key(&one.port).cmp(&key(&other.port)));
    Ok(ports)
}

fn of(info: SerialPortInfo) -> Port {
    let (kind, usb) = match info.port_type {
        SerialPortType::UsbPort(usb) => ("usb", Some(usb)),
        SerialPortType::BluetoothPort => ("bluetooth", None),
        SerialPortType::PciPort | SerialPortType::Unknown => ("built_in", None),
    };
    let numbers = usb.as_ref().map(|usb| format!("{:04x}:{:04x}", usb.vid, usb.pid));
    let (adapter, maker, serial_number) =
        usb.map_or((None, None, None), |usb| (usb.product, usb.manufacturer, usb.serial_number));
    let latency_timer_ms = latency_timer(Path::new(&info.port_name));
    Port { port: info.port_name, kind, adapter, maker, serial_number, usb: numbers, latency_timer_ms }
}

/// Returns a name without the number at its end, and that number.
fn key(name: &str) -> (&str, u32) {
    let letters = name.trim_end_matches(|c: char| c.is_ascii_digit());
    (letters, name.get(letters.len()..).and_then(|number| number.parse().ok()).unwrap_or(0))
}

/// Returns the time for which the chip of a USB adapter collects bytes, in milliseconds; `None`: the port has no such chip.
///
/// FTDI's chips wait 16 ms by default for more bytes: a reply that is due in 15 ms comes too late over each of them.
pub fn latency_timer(path: &Path) -> Option<u32> {
    #[cfg(windows)]
    return super::windows::latency_timer(path.to_str()?);
    #[cfg(not(windows))]
    return latency_timer_in(Path::new("/sys/class/tty"), path);
}

#[cfg(not(windows))]
fn latency_timer_in(class: &Path, path: &Path) -> Option<u32> {
    // A port may be named by a link, as in /dev/serial/by-id.
    let port = path.canonicalize().ok()?;
    let text = std::fs::read_to_string(class.join(port.file_name()?).join("device/latency_timer")).ok()?;
    text.trim().parse().ok()
}

#[cfg(test)]
mod tests {
    use serialport::UsbPortInfo;

    use super::*;

    #[test]
    fn a_port_has_what_its_adapter_says_of_itself() {
        let usb = UsbPortInfo {
            vid: 0x0403,
            pid: 0x6001,
            serial_number: Some("A600DXXY".into()),
            manufacturer: Some("FTDI".into()),
            product: Some("FT232R USB UART".into()),
        };
        let info = SerialPortInfo { port_name: "COM12".into(), port_type: SerialPortType::UsbPort(usb) };
        assert_eq!(
            serde_json::to_string(&of(info)).unwrap(),
            r#"{"port":"COM12","kind":"usb","adapter":"FT232R USB UART","maker":"FTDI","serial_number":"A600DXXY","usb":"0403:6001","latency_timer_ms":null}"#
        );
        let info = SerialPortInfo { port_name: "/dev/ttyS0".into(), port_type: SerialPortType::PciPort };
        assert_eq!(of(info).kind, "built_in");
    }

    #[test]
    fn numbers_are_in_their_order() {
        let mut names = ["COM12", "COM5", "/dev/ttyUSB1", "COM", "/dev/ttyUSB0"];
        names.sort_by(|one, other| key(one).cmp(&key(other)));
        assert_eq!(names, ["/dev/ttyUSB0", "/dev/ttyUSB1", "COM", "COM5", "COM12"]);
    }

    #[cfg(unix)]
    #[test]
    fn the_latency_timer_of_a_port_is_found_through_its_link() {
        let folder = tempfile::tempdir().unwrap();
        let [port, link] = ["ttyUSB0", "by-id"].map(|name| folder.path().join(name));
        std::fs::write(&port, "").unwrap();
        std::os::unix::fs::symlink(&port, &link).unwrap();
        let class = folder.path().join("class");
        std::fs::create_dir_all(class.join("ttyUSB0/device")).unwrap();
        assert_eq!(latency_timer_in(&class, &link), None);
        std::fs::write(class.join("ttyUSB0/device/latency_timer"), "16\n").unwrap();
        assert_eq!(latency_timer_in(&class, &link), Some(16));
        assert_eq!(latency_timer_in(&class, Path::new("/nowhere")), None);
    }
}
