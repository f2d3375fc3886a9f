use std::hint::black_box;

use criterion::Criterion;
use fanuc_hmi_modbus::{Frame, Reply, TelemetryBlock, WordOrder, Words};
use robot_session::Encode as _;

pub(crate) fn bench(criterion: &mut Criterion) {
    let block =
        TelemetryBlock { life_counter: 100_000, position: [123.456, -50.0, 300.25], ..Default::default() };
    let write = |block: &TelemetryBlock, out: &mut [u8]| {
        let registers = block.to_registers(WordOrder::LowFirst);
        let pdu = Reply::HoldingRegisters(Words::from(&registers));
        Frame { transaction: Some(1), unit: 1, pdu }.encode(out).expect("it fits")
    };
    let mut out = [0; Frame::MAX_LEN];
    let len = write(&block, &mut out);
    let bytes = out[..len].to_vec();
    let read = |bytes: &[u8]| {
        let (frame, _) = Frame::decode_tcp(bytes).expect("good").expect("whole");
        let Reply::HoldingRegisters(words) = frame.reply().expect("good").pdu else { panic!("other") };
        TelemetryBlock::from_words(&words, WordOrder::LowFirst)
    };
    assert_eq!(read(&bytes), Some(block));
    let mut group = super::group(criterion, "fanuc-hmi-modbus", len);
    group.bench_function("decode a reply with the telemetry block", |b| {
        b.iter(|| black_box(read(black_box(&bytes))))
    });
    group.bench_function("encode it", |b| b.iter(|| write(black_box(&block), black_box(&mut out))));
}
