//! JSON: every key of every object is needed and checked, and a writer that is full is an error.

use fanuc_hmi_modbus::{Bits, Frame, PduBuf, Reply, Request, Words};
use serde_json::{Value, json};

/// Returns an object of each function, and whether it is a request.
fn objects() -> Vec<(Value, bool)> {
    let requests = [
        json!({"transaction":1,"unit":2,"function":1,"address":3,"quantity":4}),
        json!({"transaction":1,"unit":2,"function":2,"address":3,"quantity":4}),
        json!({"transaction":1,"unit":2,"function":3,"address":3,"quantity":4}),
        json!({"transaction":1,"unit":2,"function":4,"address":3,"quantity":4}),
        json!({"unit":2,"function":5,"address":3,"value":true}),
        json!({"unit":2,"function":6,"address":3,"value":65535}),
        json!({"unit":2,"function":8,"subfunction":3,"values":[4]}),
        json!({"unit":2,"function":15,"address":3,"values":[true,false]}),
        json!({"unit":2,"function":16,"address":3,"values":[7,65535]}),
        json!({"unit":2,"function":22,"address":3,"and":5,"or":6}),
        json!({"unit":2,"function":23,"address":3,"quantity":4,"write_address":5,"values":[6]}),
        json!({"unit":2,"function":17}),
        json!({"unit":2,"function":43,"category":1,"object":3}),
        json!({"unit":2,"function":100,"data":[0,255]}),
    ];
    let replies = [
        json!({"transaction":1,"unit":2,"function":1,"bits":[1,0,1,0,0,0,0,0]}),
        json!({"transaction":1,"unit":2,"function":2,"bits":[1,0,1,0,0,0,0,0]}),
        json!({"transaction":1,"unit":2,"function":3,"registers":[1,65535]}),
        json!({"transaction":1,"unit":2,"function":4,"registers":[1]}),
        json!({"unit":2,"function":5,"address":3,"value":false}),
        json!({"unit":2,"function":6,"address":3,"value":0}),
        json!({"unit":2,"function":8,"subfunction":3,"values":[4]}),
        json!({"unit":2,"function":15,"address":3,"quantity":9}),
        json!({"unit":2,"function":16,"address":3,"quantity":9}),
        json!({"unit":2,"function":22,"address":3,"and":5,"or":6}),
        json!({"unit":2,"function":23,"registers":[6]}),
        json!({"unit":2,"function":17,"id":[5,255]}),
        json!({"unit":2,"function":43,"category":1,"conformity":129,"more":true,"next":2,"objects":[{"id":0,"text":"F\u{fc}"}]}),
        json!({"unit":2,"function":100,"data":[0,255]}),
        json!({"unit":2,"function":3,"exception":2}),
    ];
    requests
        .into_iter()
        .map(|object| (object, true))
        .chain(replies.into_iter().map(|object| (object, false)))
        .collect()
}

fn read(object: &Value) -> Result<Frame<PduBuf>, String> {
    serde_json::from_value(object.clone()).map_err(|error| error.to_string())
}

#[test]
fn every_object_reads_and_is_written_again() {
    for (object, is_request) in objects() {
        let frame = read(&object).unwrap();
        let written = match is_request {
            true => serde_json::to_value(frame.as_ref().request().unwrap()).unwrap(),
            false => serde_json::to_value(frame.as_ref().reply().unwrap()).unwrap(),
        };
        // Bits may be numbers or truth values.
        let plain = |value: &Value| value.to_string().replace("true", "1").replace("false", "0");
        assert_eq!(plain(&written), plain(&object));
    }
}

#[test]
fn no_key_can_be_left_out_but_the_transaction() {
    for (object, _) in objects() {
        let whole = read(&object).unwrap();
        for key in object.as_object().unwrap().keys() {
            let mut less = object.clone();
            less.as_object_mut().unwrap().remove(key);
            match read(&less) {
                Ok(frame) if key == "transaction" => {
                    assert_eq!((frame.transaction, frame.pdu), (None, whole.pdu));
                    less[key] = Value::Null;
                    assert_eq!(read(&less).unwrap(), frame);
                }
                // The request of the same function.
                Ok(frame) if key == "id" => assert_eq!(frame.pdu.as_bytes(), [17]),
                Ok(frame) => panic!("{less} is {frame:?}"),
                Err(error) => assert_ne!(error, ""),
            }
            let mut wrong = object.clone();
            wrong[key] = json!("x");
            let error = read(&wrong).unwrap_err();
            assert!(error.starts_with("invalid type: string \"x\", expected"), "{wrong}: {error}");
        }
    }
}

#[test]
fn a_writer_that_is_full_is_an_error_wherever_it_is() {
    for (object, is_request) in objects() {
        let frame = read(&object).unwrap();
        let (request, reply) = (frame.as_ref().request(), frame.as_ref().reply());
        let write = |out: &mut [u8]| match is_request {
            true => serde_json::to_writer(out, &request.unwrap()),
            false => serde_json::to_writer(out, &reply.unwrap()),
        };
        let length = match is_request {
            true => serde_json::to_string(&request.unwrap()).unwrap().len(),
            false => serde_json::to_string(&reply.unwrap()).unwrap().len(),
        };
        for room in 0..length {
            assert!(write(&mut vec![0; room]).is_err(), "{room} bytes for {object}");
        }
        assert!(write(&mut vec![0; length]).is_ok());
    }
}

#[test]
fn what_a_frame_cannot_hold_says_what_is_wrong() {
    let bits = vec![1; 2001];
    for (object, expected) in [
        (json!([]), "invalid type: sequence, expected the object of a Modbus frame"),
        (json!({"unit":256,"function":17}), "invalid value: integer `256`, expected u8"),
        (json!({"unit":1,"function":3,"colour":1}), "a key that no Modbus frame has"),
        (json!({"unit":1,"function":3}), "a key is missing: address"),
        (json!({"unit":1,"function":99}), "a key is missing: data"),
        (json!({"unit":1,"function":1,"bits":[2]}), "a value does not fit: a bit is false, true, 0 or 1"),
        (
            json!({"unit":1,"function":5,"address":0,"value":2}),
            "a value does not fit: a bit is false, true, 0 or 1",
        ),
        (json!({"unit":1,"function":99,"data":[256]}), "a value does not fit: a byte is 0 to 255"),
        (
            json!({"unit":1,"function":99,"data":vec![0; 254]}),
            "a value does not fit: more data than a PDU holds",
        ),
        (
            json!({"unit":1,"function":1,"bits":bits}),
            "invalid length 2001, expected a list of numbers or of bits",
        ),
        (
            json!({"unit":1,"function":3,"registers":7}),
            "invalid type: integer `7`, expected a list of numbers or of bits",
        ),
        (
            json!({"unit":1,"function":6,"address":0,"value":65536}),
            "invalid value: integer `65536`, expected 0 to 65535, or true or false",
        ),
        (
            json!({"unit":1,"function":6,"address":0,"value":-1}),
            "invalid type: integer `-1`, expected 0 to 65535, or true or false",
        ),
        (
            json!({"unit":1,"function":43,"objects":[{"id":1,"text":"\u{100}"}]}),
            "invalid value: string \"\u{100}\", expected a text of at most 255 characters up to U+00FF",
        ),
        (
            json!({"unit":1,"function":43,"objects":7}),
            "invalid type: integer `7`, expected a list of objects with id and text",
        ),
        (json!({"unit":1,"function":43,"objects":[{"id":1}]}), "missing field `text`"),
        (
            json!({"unit":1,"function":43,"objects":[{"id":1,"text":"a".repeat(256)}]}),
            "invalid value: string \"aaa",
        ),
        (
            json!({"unit":1,"function":43,"objects":vec![json!({"id":1,"text":"a".repeat(255)}); 8]}),
            "more objects than a PDU holds",
        ),
        (json!({"unit":1,"function":43,"category":1}), "a key is missing: object"),
        (
            json!({"unit":1,"function":3,"address":0,"quantity":126}),
            "quantity 126 in function 3 is not within 1 to 125",
        ),
    ] {
        let error = read(&object).unwrap_err();
        assert!(error.starts_with(expected), "{object}: {error}");
    }
}

#[test]
fn runs_print_as_lists() {
    assert_eq!(format!("{:?}", Words::from_wire(&[1, 2, 3, 4])), "[258, 772]");
    assert_eq!(format!("{:?}", Bits::from(&[true, false])), "[1, 0]");
    let pdu = PduBuf::new(&Request::ReadCoils { address: 1, quantity: 16 }).unwrap();
    assert_eq!(format!("{pdu:?}"), "PduBuf([01, 00, 01, 00, 10])");
    assert_eq!(
        pdu.reply().unwrap_err().to_string(),
        PduBuf::new(&pdu.as_bytes()).unwrap().reply().unwrap_err().to_string()
    );
    assert_eq!(pdu, PduBuf::new(&pdu.request().unwrap()).unwrap());
    assert_ne!(pdu, PduBuf::new(&Reply::WriteCoil { address: 1, value: true }).unwrap());
}
