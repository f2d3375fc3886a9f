//! Diagnostics and identification of a device: functions 8, 17 and 43.

use fanuc_hmi_modbus::security::{Access, GuardedRegisters};
use fanuc_hmi_modbus::{
    DecodeError, DeviceIdentification, DeviceObjects, Exception, Mismatch, Pdu, PduBuf, Registers, Reply,
    Request, Words, WordsMut, limit, serve,
};

/// A device with these objects.
struct Device(&'static [(u8, &'static [u8])]);

impl Registers for Device {
    fn diagnose(&mut self, subfunction: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.set(0, subfunction);
        Ok(())
    }
    fn server_id(&mut self, out: &mut [u8]) -> Result<usize, Exception> {
        let id = self.value(0x80).ok_or(Exception::IllegalFunction)?;
        assert_eq!(out.len(), 250);
        out.iter_mut().zip(id).for_each(|(to, from)| *to = *from);
        Ok(id.len())
    }
    fn device_object(&mut self, id: u8, out: &mut [u8]) -> Option<usize> {
        let value = self.value(id)?;
        assert_eq!(out.len(), 244);
        out.iter_mut().zip(value).for_each(|(to, from)| *to = *from);
        Some(value.len())
    }
}

impl Device {
    fn value(&self, id: u8) -> Option<&'static [u8]> {
        self.0.iter().find_map(|(found, value)| (*found == id).then_some(*value))
    }
}

fn answer(device: &mut Device, request: &Request<'_>) -> PduBuf {
    let mut out = [0; limit::PDU];
    let length = serve(PduBuf::new(request).unwrap().as_bytes(), device, &mut out);
    PduBuf::new(&&out[..length]).unwrap()
}

/// Returns the answer: ids, and the first object that did not fit; or the exception.
fn identified(device: &mut Device, category: u8, object: u8) -> Result<(Vec<u8>, u8, Option<u8>), Exception> {
    let request = Request::ReadDeviceIdentification { category, object };
    let pdu = answer(device, &request);
    let reply = pdu.reply().unwrap();
    assert_eq!(reply.answers(&request), Ok(()));
    match reply {
        Reply::DeviceIdentification(it) => {
            assert_eq!(it.category, category);
            let ids = it.objects.iter().map(|(id, value)| {
                assert_eq!(device.value(id), Some(value));
                id
            });
            Ok((ids.collect(), it.conformity, it.more.then_some(it.next)))
        }
        Reply::Exception { exception, .. } => Err(exception),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_device_gives_its_objects_by_category_as_many_as_fit() {
    let mut basic = Device(&[(0, b"vendor"), (1, b"code"), (2, b"1.0")]);
    for category in [1, 2, 3] {
        assert_eq!(identified(&mut basic, category, 0), Ok((vec![0, 1, 2], 0x81, None)));
        assert_eq!(identified(&mut basic, category, 1), Ok((vec![1, 2], 0x81, None)));
        assert_eq!(
            identified(&mut basic, category, 3),
            Ok((vec![0, 1, 2], 0x81, None)),
            "it has none: from 0 on"
        );
    }
    assert_eq!(identified(&mut basic, 4, 2), Ok((vec![2], 0x81, None)));
    assert_eq!(identified(&mut basic, 4, 3), Err(Exception::IllegalDataAddress));
    for category in [0, 5, 255] {
        assert_eq!(identified(&mut basic, category, 0), Err(Exception::IllegalDataValue));
    }
    let mut regular = Device(&[(0, b"vendor"), (3, b"web"), (0x7F, &[b'r'; 244])]);
    assert_eq!(identified(&mut regular, 1, 3), Ok((vec![0], 0x82, None)), "3 is not a basic one");
    assert_eq!(identified(&mut regular, 2, 0), Ok((vec![0, 3], 0x82, Some(0x7F))));
    assert_eq!(identified(&mut regular, 2, 0x7F), Ok((vec![0x7F], 0x82, None)), "244 bytes fit");
    let mut extended = Device(&[(0, &[]), (0x80, &[1; 121]), (0x81, &[2; 121]), (0xFF, &[3; 245])]);
    assert_eq!(identified(&mut extended, 2, 0), Ok((vec![0], 0x83, None)));
    assert_eq!(identified(&mut extended, 3, 0), Ok((vec![0, 0x80], 0x83, Some(0x81))));
    assert_eq!(identified(&mut extended, 4, 0x80), Ok((vec![0x80], 0x83, None)));
    assert_eq!(
        identified(&mut extended, 3, 0x80),
        Err(Exception::ServerDeviceFailure),
        "an object of 245 bytes"
    );
    let mut full = Device(&[(0, &[]), (0x80, &[1; 121]), (0x81, &[2; 121]), (0xFF, &[])]);
    assert_eq!(identified(&mut full, 3, 0x80), Ok((vec![0x80, 0x81], 0x83, Some(0xFF))), "246 bytes fit");
    assert_eq!(identified(&mut extended, 4, 0xFF), Err(Exception::ServerDeviceFailure));
    for category in [0, 1, 4] {
        assert_eq!(identified(&mut Device(&[(1, b"code")]), category, 1), Err(Exception::IllegalFunction));
    }
}

#[test]
fn a_guard_decides_about_each_object_and_subfunction() {
    let device = Device(&[(0, b"vendor"), (1, b"code"), (0x80, b"id")]);
    let allows = |access: Access| match access {
        Access { function: 43, address, quantity: 1 } => address != 1,
        Access { function: 8, address, quantity: 2 } => address == 7,
        Access { function: 17, address: 0, quantity: 0 } => true,
        _ => false,
    };
    let mut guarded = GuardedRegisters::new(device, allows);
    let mut answer = |request: &Request<'_>| {
        let mut out = [0; limit::PDU];
        let length = serve(PduBuf::new(request).unwrap().as_bytes(), &mut guarded, &mut out);
        out[..length].to_vec()
    };
    let objects = answer(&Request::ReadDeviceIdentification { category: 1, object: 0 });
    assert_eq!(objects[..9], [43, 14, 1, 0x83, 0, 0, 1, 0, 6]);
    assert_eq!(answer(&Request::ReadDeviceIdentification { category: 4, object: 1 }), [0xAB, 2]);
    assert_eq!(answer(&Request::ReportServerId), [17, 2, b'i', b'd']);
    let data = Words::from(&[1, 2]);
    assert_eq!(answer(&Request::Diagnostics { subfunction: 7, data }), [8, 0, 7, 0, 7, 0, 2]);
    assert_eq!(answer(&Request::Diagnostics { subfunction: 8, data }), [0x88, 1]);
}

#[test]
fn an_id_is_of_1_to_250_bytes() {
    let id = |device: &mut Device| answer(device, &Request::ReportServerId);
    assert_eq!(id(&mut Device(&[(0x80, &[9, 255])])).as_bytes(), [17, 2, 9, 255]);
    assert_eq!(id(&mut Device(&[(0x80, &[7; 250])])).as_bytes().len(), 252);
    assert_eq!(id(&mut Device(&[(0x80, &[7; 251])])).as_bytes(), [0x91, 4]);
    assert_eq!(id(&mut Device(&[(0x80, &[])])).as_bytes(), [0x91, 4]);
    assert_eq!(id(&mut Device(&[])).as_bytes(), [0x91, 1]);
}

#[test]
fn a_diagnostic_is_answered_with_its_own_words_unless_the_device_changes_them() {
    let request = Request::Diagnostics { subfunction: 0x1234, data: Words::from(&[5, 6]) };
    let pdu = answer(&mut Device(&[]), &request);
    assert_eq!(pdu.as_bytes(), [8, 0x12, 0x34, 0x12, 0x34, 0, 6]);
    assert_eq!(pdu.reply().unwrap().answers(&request), Ok(()));
    let data = Words::from(&[1, 2]);
    for (subfunction, found, words, answers) in [
        (0, 0, [1, 2], Ok(())),
        (0, 0, [1, 3], Err(Mismatch::Echo)),
        (0, 1, [1, 2], Err(Mismatch::Echo)),
        (1, 1, [1, 3], Ok(())),
        (1, 2, [1, 2], Err(Mismatch::Echo)),
    ] {
        let reply = Reply::Diagnostics { subfunction: found, data: Words::from(&words) };
        assert_eq!(reply.answers(&Request::Diagnostics { subfunction, data }), answers);
    }
    for length in 1..8 {
        let pdu = &[8, 0, 0, 0, 1, 0, 2][..length.min(7)];
        let expected = if length < 5 { 5 } else { length | 1 };
        let error = DecodeError::PduLength { function: 8, expected, found: pdu.len() };
        let is_good = [5, 7].contains(&pdu.len());
        assert_eq!(Request::decode(pdu).err(), (!is_good).then_some(error), "{length}");
        assert_eq!(Reply::decode(pdu).err(), (!is_good).then_some(error), "{length}");
    }
}

#[test]
fn objects_are_whole_and_fill_the_pdu() {
    let objects = DeviceObjects::from_wire(&[0, 3, b'a', b'b', b'c', 1, 0, 7, 9, 1]);
    let listed: Vec<_> = objects.iter().collect();
    assert_eq!(listed, [(0, &b"abc"[..]), (1, b"")], "the last one is not whole");
    assert_eq!((objects.get(0), objects.get(1), objects.get(7)), (Some(&b"abc"[..]), Some(&b""[..]), None));
    assert_eq!(format!("{objects:?}"), "{0: [97, 98, 99], 1: []}");
    let it = DeviceIdentification { category: 1, conformity: 0x81, more: true, next: 5, objects };
    let reply = Reply::DeviceIdentification(it);
    let whole = [43, 14, 1, 0x81, 0xFF, 5, 2, 0, 3, b'a', b'b', b'c', 1, 0];
    let mut out = [0; limit::PDU];
    assert_eq!((reply.encode(&mut out), reply.encoded_len()), (Ok(14), 14));
    assert_eq!(out[..14], whole);
    assert_eq!(Reply::decode(&whole), Ok(reply));
    let other = Request::ReadDeviceIdentification { category: 2, object: 0 };
    assert_eq!(reply.answers(&other), Err(Mismatch::Echo));
    for (length, expected) in [(2, 7), (6, 7), (7, 9), (8, 9), (9, 12), (11, 12), (12, 14), (13, 14)] {
        let error = DecodeError::PduLength { function: 43, expected, found: length };
        assert_eq!(Reply::decode(&whole[..length]), Err(error), "{length}");
    }
    let long = [&whole[..], &[0]].concat();
    let error = DecodeError::PduLength { function: 43, expected: 14, found: 15 };
    assert_eq!(Reply::decode(&long), Err(error));
    let odd = [43, 14, 1, 0x81, 1, 0, 0];
    let error = Reply::decode(&odd).unwrap_err();
    assert_eq!(error, DecodeError::MoreFollows { found: 1 });
    assert_eq!(error.to_string(), "more follows is 0x01, neither 0xff nor 0 (at byte 4 of the PDU)");
}

#[test]
fn function_43_with_another_mei_type_is_raw() {
    for data in [&[][..], &[13], &[13, 0, 1]] {
        let pdu = PduBuf::new(&Request::Other { function: 43, data }).unwrap();
        assert_eq!(pdu.request(), Ok(Request::Other { function: 43, data }));
        assert_eq!(pdu.reply(), Ok(Reply::Other { function: 43, data }));
        assert!(!pdu.request().unwrap().reads());
    }
    assert!(Request::ReportServerId.reads());
    assert!(Request::ReadDeviceIdentification { category: 1, object: 0 }.reads());
    let asked = Request::ReadDeviceIdentification { category: 1, object: 0 };
    assert_eq!(Reply::Other { function: 43, data: &[13] }.answers(&asked), Err(Mismatch::Echo));
    let objects = DeviceObjects::default();
    let it = DeviceIdentification { category: 1, conformity: 1, more: false, next: 0, objects };
    assert_eq!(Reply::DeviceIdentification(it).answers(&asked), Ok(()));
    let raw = Request::Other { function: 43, data: &[13] };
    assert_eq!(Reply::DeviceIdentification(it).answers(&raw), Err(Mismatch::Echo));
    let data = &[14, 1, 0];
    assert!(PduBuf::new(&Request::Other { function: 43, data }).is_err());
    assert!(PduBuf::new(&Reply::Other { function: 43, data }).is_err());
}
