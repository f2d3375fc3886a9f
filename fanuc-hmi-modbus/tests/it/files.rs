//! Functions 7, 11, 12, 20, 21 and 24: the serial line of a device, its files and its queues.

use fanuc_hmi_modbus::robot_session::tokio::{Tcp, serve as serve_all};
use fanuc_hmi_modbus::security::{Access, GuardedRegisters};
use fanuc_hmi_modbus::tokio::{Error, client};
use fanuc_hmi_modbus::{
    ClientConfig, CommEvents, EncodeError, Exception, FileRange, FileRecord, Mismatch, Pdu, PduBuf, Records,
    Registers, Reply, Request, Server, ServerConfig, Words, WordsMut, limit, serve,
};

/// A device with one file, whose number is 4, and a queue.
struct Device {
    file: [u16; 300],
    queue: usize,
    logged: usize,
}

const DEVICE: Device = Device { file: [0; 300], queue: 0, logged: 0 };

impl Device {
    fn run(&mut self, file: u16, record: u16, count: usize) -> Result<&mut [u16], Exception> {
        let run = usize::from(record)..usize::from(record) + count;
        self.file.get_mut(run).filter(|_| file == 4).ok_or(Exception::IllegalDataAddress)
    }
}

impl Registers for Device {
    fn exception_status(&mut self) -> Result<u8, Exception> {
        Ok(0x6D)
    }
    fn comm_events(&mut self, log: &mut [u8]) -> Result<CommEvents, Exception> {
        assert!([0, 64].contains(&log.len()));
        log.fill(0x40);
        Ok(CommEvents { status: 0xFFFF, events: 264, messages: 289, logged: self.logged })
    }
    fn read_file(&mut self, file: u16, record: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.copy_from(self.run(file, record, out.len())?);
        Ok(())
    }
    fn write_file(&mut self, file: u16, record: u16, values: Words<'_>) -> Result<(), Exception> {
        values.copy_to(self.run(file, record, values.len())?);
        Ok(())
    }
    fn read_fifo(&mut self, address: u16, out: &mut WordsMut<'_>) -> Result<usize, Exception> {
        assert_eq!((address, out.len()), (1246, 31));
        out.fill_with(|at| u16::try_from(at).unwrap());
        Ok(self.queue)
    }
}

fn answer(device: &mut impl Registers, request: &Request<'_>) -> PduBuf {
    let mut out = [0; limit::PDU];
    let length = serve(PduBuf::new(request).unwrap().as_bytes(), device, &mut out);
    let pdu = PduBuf::new(&&out[..length]).unwrap();
    assert_eq!(pdu.reply().unwrap().answers(request), Ok(()));
    pdu
}

#[test]
fn files_are_written_and_read_run_by_run() {
    let mut device = DEVICE;
    let records = [
        FileRecord { file: 4, record: 7, values: Words::from(&[0x6AF, 0x4BE]) },
        FileRecord { file: 4, record: 299, values: Words::from(&[0x100D]) },
    ];
    let write = Request::WriteFileRecord(Records::from(&records));
    assert_eq!(answer(&mut device, &write), PduBuf::new(&write).unwrap());
    let ranges = [
        FileRange { file: 4, record: 6, quantity: 3 },
        FileRange { file: 4, record: 299, quantity: 1 },
        FileRange { file: 4, record: 0, quantity: 100 },
    ];
    let pdu = answer(&mut device, &Request::ReadFileRecord(Records::from(&ranges)));
    let Ok(Reply::FileRecords(groups)) = pdu.reply() else { panic!("{pdu:?}") };
    let groups: Vec<Vec<u16>> = groups.iter().map(|words| words.iter().collect()).collect();
    assert_eq!(groups[..2], [vec![0, 0x6AF, 0x4BE], vec![0x100D]]);
    assert_eq!(groups[2].len(), 100);
    for (file, record) in [(3, 0), (4, 300), (4, 0xFFFF)] {
        let range = [ranges[0], FileRange { file, record, quantity: 2 }];
        let read = answer(&mut device, &Request::ReadFileRecord(Records::from(&range)));
        assert_eq!(read.as_bytes(), [0x94, 2]);
        let values = Words::from(&[1, 2]);
        let record = [FileRecord { file, record, values }];
        let write = answer(&mut device, &Request::WriteFileRecord(Records::from(&record)));
        assert_eq!(write.as_bytes(), [0x95, 2]);
    }
}

#[test]
fn a_run_beyond_record_65535_writes_nothing() {
    let mut device = DEVICE;
    let values = Words::from(&[1, 2]);
    let records = [FileRecord { file: 4, record: 0, values }, FileRecord { file: 4, record: 0xFFFF, values }];
    let pdu = answer(&mut device, &Request::WriteFileRecord(Records::from(&records)));
    assert_eq!((pdu.as_bytes(), device.file[0]), (&[0x95, 2][..], 0));
}

#[test]
fn a_queue_has_at_most_31_registers_and_a_log_64_events() {
    let queue = |queue| answer(&mut Device { queue, ..DEVICE }, &Request::ReadFifoQueue { address: 1246 });
    assert_eq!(queue(0).as_bytes(), [24, 0, 2, 0, 0]);
    assert_eq!(queue(2).as_bytes(), [24, 0, 6, 0, 2, 0, 0, 0, 1]);
    assert_eq!(queue(31).as_bytes().len(), 67);
    assert_eq!(queue(32).as_bytes(), [0x98, 3]);
    let log = |logged| answer(&mut Device { logged, ..DEVICE }, &Request::GetCommEventLog);
    assert_eq!(log(0).as_bytes(), [12, 6, 0xFF, 0xFF, 1, 8, 1, 33]);
    assert_eq!(log(64).as_bytes().len(), 72);
    assert_eq!(log(65).as_bytes(), [0x8C, 4]);
    assert_eq!(
        answer(&mut Device { ..DEVICE }, &Request::GetCommEventCounter).as_bytes(),
        [11, 0xFF, 0xFF, 1, 8]
    );
    assert_eq!(answer(&mut Device { ..DEVICE }, &Request::ReadExceptionStatus).as_bytes(), [7, 0x6D]);
}

#[test]
fn a_server_without_them_answers_exception_1() {
    struct None;
    impl Registers for None {}
    let range = [FileRange { file: 4, record: 1, quantity: 1 }];
    let record = [FileRecord { file: 4, record: 1, values: Words::from(&[1]) }];
    for request in [
        Request::ReadExceptionStatus,
        Request::GetCommEventCounter,
        Request::GetCommEventLog,
        Request::ReadFileRecord(Records::from(&range)),
        Request::WriteFileRecord(Records::from(&record)),
        Request::ReadFifoQueue { address: 0 },
    ] {
        assert_eq!(answer(&mut None, &request).as_bytes(), [request.function() | 0x80, 1]);
    }
}

#[test]
fn a_guard_decides_about_each_run_and_function() {
    let allows = |access: Access| match access {
        Access { function: 20, address: 4, quantity } => quantity < 3,
        Access { function: 21, address: 4, quantity } => quantity == 1,
        Access { function: 24, address, quantity: 0 } => address == 1246,
        Access { function: 7 | 12, address: 0, quantity: 0 } => true,
        _ => false,
    };
    let mut guarded = GuardedRegisters::new(DEVICE, allows);
    let mut code = |request: &Request<'_>| answer(&mut guarded, request).as_bytes()[0];
    for (quantity, expected) in [(2, 20), (3, 0x94)] {
        let range = [FileRange { file: 4, record: 1, quantity }];
        assert_eq!(code(&Request::ReadFileRecord(Records::from(&range))), expected);
    }
    for (values, expected) in [(&[1][..], 21), (&[1, 2], 0x95)] {
        let record = [FileRecord { file: 4, record: 1, values: values.into() }];
        assert_eq!(code(&Request::WriteFileRecord(Records::from(&record))), expected);
    }
    assert_eq!(code(&Request::ReadExceptionStatus), 7);
    assert_eq!(code(&Request::GetCommEventCounter), 0x8B);
    assert_eq!(code(&Request::GetCommEventLog), 12);
    assert_eq!(code(&Request::ReadFifoQueue { address: 1246 }), 24);
    assert_eq!(code(&Request::ReadFifoQueue { address: 1247 }), 0x98);
}

#[test]
fn a_reply_about_files_has_the_runs_that_were_asked_for() {
    let range = |quantity| FileRange { file: 4, record: 1, quantity };
    let asked = [range(2), range(1)];
    let request = Request::ReadFileRecord(Records::from(&asked));
    let (one, two) = (Words::from(&[1]), Words::from(&[1, 2]));
    for (groups, expected) in [
        (&[two, one][..], Ok(())),
        (&[one, two], Err(Mismatch::Echo)),
        (&[two], Err(Mismatch::Echo)),
        (&[two, one, one], Err(Mismatch::Echo)),
    ] {
        assert_eq!(Reply::FileRecords(groups.into()).answers(&request), expected);
    }
    let written = |values| [FileRecord { file: 4, record: 1, values }];
    let (sent, other) = (written(one), written(two));
    let request = Request::WriteFileRecord(Records::from(&sent));
    assert_eq!(Reply::WriteFileRecord(Records::from(&sent)).answers(&request), Ok(()));
    assert_eq!(Reply::WriteFileRecord(Records::from(&other)).answers(&request), Err(Mismatch::Echo));
}

#[test]
fn runs_in_memory_are_those_on_the_wire_and_have_its_limits() {
    let range = |quantity| FileRange { file: 4, record: 1, quantity };
    let ranges = [range(2), range(3)];
    let pdu = PduBuf::new(&Request::ReadFileRecord(Records::from(&ranges))).unwrap();
    assert_eq!(pdu.as_bytes(), [20, 14, 6, 0, 4, 0, 1, 0, 2, 6, 0, 4, 0, 1, 0, 3]);
    let wire = Records::from_wire(&pdu.as_bytes()[2..]);
    assert_eq!((wire, format!("{wire:?}")), (Records::from(&ranges), format!("{ranges:?}")));
    assert_ne!(wire, Records::from(&ranges[..1]));
    let refused = |ranges: &[FileRange]| PduBuf::new(&Request::ReadFileRecord(ranges.into())).err();
    let quantity = |found, max| Some(EncodeError::Quantity { function: 20, found, max });
    assert_eq!(refused(&[]), quantity(0, 121));
    assert_eq!(refused(&[range(0)]), quantity(0, 121));
    assert_eq!(refused(&[range(122)]), quantity(122, 121));
    assert_eq!(refused(&[range(60), range(61)]), quantity(61, 60));
    assert_eq!(
        (refused(&[range(1); 35]), refused(&[range(1); 36])),
        (None, Some(EncodeError::PduLength { found: 254 }))
    );
    let values = [7; 123];
    let record = [FileRecord { file: 4, record: 1, values: Words::from(&values) }];
    let error = Request::WriteFileRecord(Records::from(&record)).encode(&mut [0; limit::PDU]);
    assert_eq!(error, Err(EncodeError::Quantity { function: 21, found: 123, max: 122 }));
}

#[tokio::test]
#[allow(clippy::disallowed_methods, reason = "the driver takes the time")]
async fn a_handle_has_a_method_for_each() {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let device = |_| Server::<_>::new(ServerConfig::tcp(), Device { queue: 2, logged: 3, ..DEVICE }).unwrap();
    tokio::spawn(serve_all(listener, 1, device, |_, _, _| {}));
    let (robot, task) = client(ClientConfig::tcp(), Tcp::new(address.to_string())).unwrap();
    tokio::spawn(task.run());
    assert_eq!(robot.read_exception_status().await.unwrap(), 0x6D);
    assert_eq!(robot.comm_event_counter().await.unwrap(), (0xFFFF, 264));
    let events = CommEvents { status: 0xFFFF, events: 264, messages: 289, logged: 3 };
    assert_eq!(robot.comm_event_log().await.unwrap(), (events, vec![0x40; 3]));
    robot.write_files(&[FileRecord { file: 4, record: 7, values: Words::from(&[1, 2]) }]).await.unwrap();
    let ranges =
        [FileRange { file: 4, record: 7, quantity: 2 }, FileRange { file: 4, record: 0, quantity: 1 }];
    assert_eq!(robot.read_files(&ranges).await.unwrap(), [vec![1, 2], vec![0]]);
    assert_eq!(robot.read_fifo_queue(1246).await.unwrap(), [0, 1]);
    let absent = [FileRange { file: 3, record: 0, quantity: 1 }];
    let refused = robot.read_files(&absent).await;
    assert!(matches!(refused, Err(Error::Exception(Exception::IllegalDataAddress))), "{refused:?}");
}
