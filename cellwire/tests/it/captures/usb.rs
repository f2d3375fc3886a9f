//! USB serial adapters in captures of usbmon and USBPcap.

use std::fs;
use std::process::{Command, Stdio};

use serde_json::{Value, json};

use super::make::{Form, LITTLE, whole};

/// The program that wrote the capture.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Program {
    Usbmon,
    UsbmonMapped,
    UsbPcap,
}

const PROGRAMS: [(Program, u32); 3] =
    [(Program::Usbmon, 189), (Program::UsbmonMapped, 220), (Program::UsbPcap, 249)];

/// An adapter that is captured.
struct Usb {
    program: Program,
    form: Form,
    device: u8,
    next: u64,
    packets: Vec<Vec<u8>>,
}

impl Usb {
    fn new(program: Program, form: Form) -> Self {
        Self { program, form, device: 5, next: 1, packets: Vec::new() }
    }

    /// Adds a transfer on its way, or back; with a setup, if given.
    fn packet(
        &mut self,
        kind: u8,
        endpoint: u8,
        is_complete: bool,
        setup: Option<[u8; 8]>,
        data: &[u8],
        want: usize,
    ) {
        let (id, device) = (self.next, self.device);
        let packet = match self.program {
            Program::UsbPcap => {
                // A control transfer has a field for its stage.
                let stage = match (kind, setup.is_some()) {
                    (2, true) => vec![0],
                    (2, false) => vec![3],
                    _ => vec![],
                };
                let data = [setup.map(|it| it.to_vec()).unwrap_or_default(), data.to_vec()].concat();
                let mut packet = (27 + stage.len() as u16).to_le_bytes().to_vec();
                packet.extend(id.to_le_bytes());
                packet.extend([0; 4]);
                packet.extend([
                    if kind == 2 { 8 } else { 9 },
                    0,
                    u8::from(is_complete),
                    1,
                    0,
                    device,
                    0,
                    endpoint,
                    kind,
                ]);
                packet.extend((data.len() as u32).to_le_bytes());
                [packet, stage, data].concat()
            }
            _ => {
                let form = self.form;
                let mut packet = if form.is_big { id.to_be_bytes() } else { id.to_le_bytes() }.to_vec();
                packet.extend([if is_complete { b'C' } else { b'S' }, kind, endpoint, device]);
                packet.extend(form.u16(1));
                packet.push(if setup.is_some() { 0 } else { b'-' });
                packet.push(if data.is_empty() { b'<' } else { 0 });
                packet.extend([0; 12]);
                packet.extend(form.u32(0));
                packet.extend(form.u32(if is_complete { data.len() } else { want } as u32));
                packet.extend(form.u32(data.len() as u32));
                packet.extend(setup.unwrap_or_default());
                if self.program == Program::UsbmonMapped {
                    packet.extend([0; 16]);
                }
                [packet, data.to_vec()].concat()
            }
        };
        self.packets.push(packet);
    }

    fn ask(&mut self, setup: [u8; 8], answer: &[u8]) {
        self.packet(2, 0x80, false, Some(setup), &[], setup[6].into());
        self.packet(2, 0x80, true, None, answer, 0);
        self.next += 1;
    }

    fn tell(&mut self, setup: [u8; 8], data: &[u8]) {
        self.packet(2, 0, false, Some(setup), data, data.len());
        self.packet(2, 0, true, None, &[], 0);
        self.next += 1;
    }

    fn described(&mut self, vendor: u16, product: u16, release: u16, configuration: &[u8]) {
        let ([a, b], [c, d], [e, f]) = (vendor.to_le_bytes(), product.to_le_bytes(), release.to_le_bytes());
        let device = [18, 1, 0, 2, 0, 0, 0, 64, a, b, c, d, e, f, 1, 2, 3, 1];
        self.ask([0x80, 6, 0, 1, 0, 0, 18, 0], &device);
        if !configuration.is_empty() {
            self.ask([0x80, 6, 0, 2, 0, 0, configuration.len() as u8, 0], configuration);
        }
    }

    fn write(&mut self, endpoint: u8, data: &[u8]) {
        self.packet(3, endpoint, false, None, data, data.len());
        self.packet(3, endpoint, true, None, &[], 0);
        self.next += 1;
    }

    fn read(&mut self, endpoint: u8, data: &[u8]) {
        self.packet(3, endpoint, false, None, &[], 512);
        self.packet(3, endpoint, true, None, data, 0);
        self.next += 1;
    }

    fn capture(&self) -> Vec<u8> {
        let link_type = PROGRAMS.iter().find(|(program, _)| *program == self.program).unwrap().1;
        self.form.pcap(link_type, &whole(self.packets.iter().cloned()))
    }
}

/// Class and subclass of an interface, and its bulk endpoints with their longest packet.
type Interface<'a> = (u8, u8, &'a [(u8, u16)]);

/// Returns a configuration of these interfaces.
fn configuration(interfaces: &[Interface<'_>]) -> Vec<u8> {
    let mut all = vec![9, 2, 0, 0, interfaces.len() as u8, 1, 0, 0x80, 50];
    for (number, (class, below, endpoints)) in (0..).zip(interfaces) {
        all.extend([9, 4, number, 0, endpoints.len() as u8, *class, *below, 0, 0]);
        for (address, packet) in *endpoints {
            let [low, high] = packet.to_le_bytes();
            all.extend([7, 5, *address, 2, low, high, 0]);
        }
    }
    all[2] = all.len() as u8;
    all
}

/// Returns the bytes as an FTDI sends them: with its status at the beginning of each packet.
fn with_status(status: [u8; 2], packet: usize, bytes: &[u8]) -> Vec<u8> {
    let packets = bytes.chunks(packet - 2).flat_map(|part| [&status[..], part].concat());
    packets.collect()
}

fn decode(link: &str, capture: &[u8], args: &str) -> (Vec<Value>, Option<i32>, String) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("usb.pcap");
    fs::write(&file, capture).unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_cellwire"));
    command.args(["decode", link, "--format", "pcap"]).args(args.split_whitespace()).arg(&file);
    let output = command.stdin(Stdio::null()).output().unwrap();
    let lines = output.stdout.split(|byte| *byte == b'\n').filter(|line| !line.is_empty());
    let lines = lines.map(|line| serde_json::from_slice(line).unwrap()).collect();
    (lines, output.status.code(), String::from_utf8(output.stderr).unwrap())
}

/// Returns a laser's instruction, and an answer that takes several packets.
fn frames() -> [Vec<u8>; 2] {
    let codec = (cellwire_links::laser_eb90::LINK.codec)("host", &serde_json::Map::new()).unwrap();
    let text: String = (0..200).map(|n| char::from(b'!' + n % 80)).collect();
    [json!({"items": [{"i16": [257]}]}), json!({"items": [{"char": text}]})]
        .map(|message| codec.encode(message).unwrap())
}

/// Returns the sender of each message, as a letter.
fn senders(lines: &[Value]) -> String {
    lines.iter().map(|line| line["from"].as_str().map_or('!', |from| from.chars().next().unwrap())).collect()
}

const FTDI: (u16, u16, u16) = (0x0403, 0x6001, 0x0600);

/// Returns, for an adapter of each kind, a capture of three instructions and answers after the driver's requests, and the
/// expected remark.
fn complete(program: Program, form: Form) -> Vec<(&'static str, Vec<u8>, &'static str)> {
    let [short, long] = frames();
    let ends = |input: u8, output: u8, packet: u16| [(input, packet), (output, packet)];
    let mut all = Vec::new();
    let mut add = |name, said, usb: Usb| all.push((name, usb.capture(), said));

    let mut usb = Usb::new(program, form);
    let (vendor, product, release) = FTDI;
    usb.described(vendor, product, release, &configuration(&[(0xFF, 0xFF, &ends(0x81, 2, 64))]));
    usb.tell([0x40, 3, 0x38, 0x41, 0, 0, 0, 0], &[]);
    usb.tell([0x40, 4, 8, 2, 0, 0, 0, 0], &[]);
    for _ in 0..3 {
        usb.write(2, &short);
        usb.read(0x81, &[1, 0x60]);
        usb.read(0x81, &with_status([1, 0x60], 64, &long));
    }
    add("FTDI", "USB 1.5: FTDI, 9600 baud 8E1\n", usb);

    let mut usb = Usb::new(program, form);
    let second = configuration(&[(0xFF, 0xFF, &ends(0x81, 2, 512)), (0xFF, 0xFF, &ends(0x83, 4, 512))]);
    usb.described(0x0403, 0x6010, 0x0700, &second);
    usb.tell([0x40, 3, 0xE2, 0x04, 2, 2, 0, 0], &[]);
    for _ in 0..3 {
        usb.read(0x81, &[0x32, 0x60]);
        usb.write(4, &short);
        usb.read(0x83, &with_status([0x32, 0x60], 512, &[&long[..], &long, &long].concat()));
    }
    add("FTDI of high speed", "USB 1.5: FTDI, 9600 baud\n", usb);

    let mut usb = Usb::new(program, form);
    usb.described(0x1A86, 0x7523, 0x0264, &[]);
    usb.tell([0x40, 0x9A, 0x12, 0x13, 0x82, 0xB2, 0, 0], &[]);
    usb.tell([0x40, 0x9A, 0x18, 0x25, 0xC3, 0, 0, 0], &[]);
    for _ in 0..3 {
        usb.write(2, &short);
        long.chunks(32).for_each(|part| usb.read(0x82, part));
    }
    add("CH340", "USB 1.5: CH340, 9600 baud 8N1\n", usb);

    let mut usb = Usb::new(program, form);
    usb.described(0x067B, 0x2303, 0x0300, &configuration(&[(0xFF, 0, &ends(0x83, 2, 64))]));
    usb.tell([0x40, 1, 0, 0, 1, 0, 0, 0], &[]);
    usb.tell([0x21, 0x20, 0, 0, 0, 0, 7, 0], &[0, 0x4B, 0, 0, 0, 2, 8]);
    for _ in 0..3 {
        usb.write(2, &short);
        usb.read(0x83, &long);
    }
    add("PL2303", "USB 1.5: PL2303, 19200 baud 8E1\n", usb);

    let mut usb = Usb::new(program, form);
    let disk_beside: [Interface<'_>; 3] =
        [(2, 2, &[]), (0x0A, 0, &ends(0x84, 3, 64)), (8, 6, &ends(0x85, 6, 64))];
    usb.described(0x2341, 0x0043, 0x0001, &configuration(&disk_beside));
    usb.tell([0x21, 0x20, 0, 0, 0, 0, 7, 0], &[0, 0xC2, 1, 0, 2, 0, 7]);
    usb.read(0x85, b"USBS");
    for _ in 0..3 {
        usb.write(3, &short);
        usb.read(0x84, &long);
    }
    let said = "USB 1.5: CDC-ACM, 115200 baud 7N2\n1 of 19 packets are neither TCP nor UDP: 1 transfers of USB 1.5, which is no serial adapter\n";
    add("CDC-ACM", said, usb);
    all
}

#[test]
fn every_adapter_is_read_whole() {
    let big = Form { is_big: true, ..LITTLE };
    for (program, form) in
        PROGRAMS.map(|(program, _)| (program, LITTLE)).into_iter().chain([(Program::UsbmonMapped, big)])
    {
        for (name, capture, expected) in complete(program, form) {
            let name = format!("{name}, {program:?}");
            let (lines, code, said) = decode("laser-eb90", &capture, "");
            let count = if name.starts_with("FTDI of high") { "hccchccchccc" } else { "hchchc" };
            let first = &lines[0];
            assert_eq!((senders(&lines), code), (count.into(), Some(0)), "{name}: {lines:?} {said}");
            assert!(first["flow"].as_str().unwrap().starts_with("program > USB 1.5"), "{name}: {first}");
            if name.starts_with("CDC-ACM") {
                // Headers of USBPcap or of usbmon: as many packets either way.
                assert!(said.starts_with(expected.lines().next().unwrap()), "{name}: {said}");
                assert!(
                    said.contains("1 transfers of USB 1.5, which is no serial adapter"),
                    "{name}: {said}"
                );
            } else {
                assert_eq!(said, expected, "{name}");
            }
        }
    }
}

/// Without its descriptor an FTDI is known by its status bytes, another by its driver's requests, or by the user's option.
#[test]
fn an_adapter_without_a_descriptor_is_found_or_asked_for() {
    let [short, long] = frames();
    let exchange = |usb: &mut Usb, input: u8, answer: &[u8]| {
        for _ in 0..3 {
            usb.write(2, &short);
            usb.read(input, answer);
        }
    };
    for (program, _) in PROGRAMS {
        let mut usb = Usb::new(program, LITTLE);
        (0..4).for_each(|_| usb.read(0x81, &[1, 0x60]));
        exchange(&mut usb, 0x81, &with_status([1, 0x60], 64, &long));
        let (lines, code, said) = decode("laser-eb90", &usb.capture(), "");
        assert_eq!((senders(&lines), code), ("hchchc".into(), Some(0)), "{said}");
        assert_eq!(said, "USB 1.5: FTDI\n");

        let mut usb = Usb::new(program, LITTLE);
        usb.tell([0x40, 0x9A, 0x12, 0x13, 0x83, 0xCC, 0, 0], &[]);
        exchange(&mut usb, 0x82, &long);
        let (lines, _, said) = decode("laser-eb90", &usb.capture(), "");
        assert_eq!((senders(&lines), said.as_str()), ("hchchc".into(), "USB 1.5: CH340, 115200 baud\n"));

        let mut usb = Usb::new(program, LITTLE);
        exchange(&mut usb, 0x81, &long);
        let (lines, code, _) = decode("laser-eb90", &usb.capture(), "");
        assert_eq!((lines.len(), code), (1, Some(1)));
        assert_eq!(lines[0]["error"], json!({"kind": "unknown_device", "device": "1.5"}));
        let (lines, code, said) = decode("laser-eb90", &usb.capture(), "--adapter cdc-acm");
        assert_eq!((senders(&lines), code), ("hchchc".into(), Some(0)), "{said}");
        // The computer is the laser's controller.
        let (lines, ..) = decode("laser-eb90", &usb.capture(), "--adapter cdc-acm --from controller");
        assert_eq!(senders(&lines), "chchch");
    }
}

#[test]
fn what_an_adapter_lost_is_said() {
    let [short, long] = frames();
    let mut usb = Usb::new(Program::UsbmonMapped, LITTLE);
    usb.described(FTDI.0, FTDI.1, FTDI.2, &[]);
    usb.write(2, &short);
    usb.read(0x81, &with_status([1, 0x62], 64, &long));
    let (lines, _, said) = decode("laser-eb90", &usb.capture(), "");
    assert_eq!(senders(&lines), "hc");
    assert!(said.contains("FTDI; 4 packets with a wrong parity, a wrong stop bit or an overrun"), "{said}");
    // Of a write the capture has only the first bytes.
    let mut frames = whole(usb.packets.iter().cloned());
    let written = usb.packets.iter().position(|packet| packet.ends_with(&short)).unwrap();
    frames[written].1 -= 4;
    let (lines, ..) = decode("laser-eb90", &LITTLE.pcap(220, &frames), "");
    let kinds: Vec<&Value> = lines.iter().map(|line| &line["error"]["kind"]).collect();
    assert_eq!(kinds, [&json!("incomplete"), &json!("cut_off"), &Value::Null], "{lines:?}");
}

#[test]
fn tshark_reads_the_same_of_what_is_generated() {
    if Command::new("tshark").arg("--version").output().is_err() {
        eprintln!("skipped: there is no tshark (apt-get install tshark)");
        return;
    }
    let [digits, answer] =
        frames().map(|frame| frame.iter().map(|byte| format!("{byte:02x}")).collect::<String>());
    let folder = tempfile::tempdir().unwrap();
    for (program, _) in PROGRAMS {
        for (name, capture, _) in complete(program, LITTLE) {
            let file = folder.path().join("usb.pcap");
            fs::write(&file, &capture).unwrap();
            let mut command = Command::new("tshark");
            command.arg("-r").arg(&file).args(["-T", "fields"]);
            let ports = ["a_tx", "b_tx", "a_rx", "b_rx"].map(|port| format!("ftdi-ft.if_{port}_payload"));
            for field in ["usb.idVendor", "_ws.malformed", "usb.capdata", "data.data"]
                .into_iter()
                .chain(ports.iter().map(String::as_str))
            {
                command.args(["-e", field]);
            }
            let text = String::from_utf8(command.output().unwrap().stdout).unwrap();
            assert_eq!(text.matches("0x").count(), 1, "{name}, {program:?}: {text}");
            // Wireshark must not take a driver's request for malformed.
            assert!(!text.contains("alformed"), "{name}, {program:?}: {text}");
            let bytes: String = text.chars().filter(char::is_ascii_hexdigit).collect();
            let answers = if name == "FTDI of high speed" { 9 } else { 3 };
            let counts = [&digits, &answer].map(|frame| bytes.matches(frame).count());
            assert_eq!(counts, [3, answers], "{name}, {program:?}: {text}");
        }
    }
}
