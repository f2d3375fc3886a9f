//! The source's rules that need no session: times, scaling, limits, modes.

use core::time::Duration;

use proptest::prelude::*;
use val2_alter::timing::{self, Budget};
use val2_alter::{
    Accumulation, CoordinateFrame, EncodeError, Exception, Frame, Framing, HostMessage, LeadingDle, Limiter,
    Limits, List, Message, Mode, Motion, MotionPhase, Polarity, Reach, Reply, RobotMessage, Scale, Transform,
};

use Accumulation::{Cumulative, NonCumulative};

/// Tenths of a millisecond, cut off as the source does.
fn tenths(time: Duration) -> u128 {
    time.as_micros() / 100
}

/// "In folgender Tabelle sind die maximalen Zeitspannen (inklusive Byte-Stuffing) vor Übertragungsbeginn der Antwortnachricht
/// … aufgelistet" (§3.4.2): all fourteen, at 19200 baud and at no other rate.
#[test]
fn the_reply_table_is_of_a_line_of_19200_baud() {
    let table = [
        (0, 8, 108, 8, 128),
        (1, 11, 92, 12, 107),
        (2, 14, 77, 16, 86),
        (3, 17, 61, 20, 65),
        (4, 20, 45, 24, 45),
        (5, 23, 30, 28, 24),
        (6, 26, 14, 32, 3),
    ];
    for (values, cumulative_len, cumulative, other_len, other) in table {
        for (accumulation, len, time) in
            [(Cumulative, cumulative_len, cumulative), (NonCumulative, other_len, other)]
        {
            assert_eq!(timing::printed_reply_len(accumulation, values), len);
            let slack = |baud| tenths(timing::reply_slack(accumulation, baud, len).unwrap());
            assert_eq!(slack(19_200), time, "{values} values, {accumulation:?}");
            assert_ne!(slack(38_400), time, "{values} values, {accumulation:?}");
        }
    }
}

/// "Für eine Baudrate von 38400 und maximal mögliches Byte-Stuffing" (§3.4.1)
#[test]
fn the_request_table_is_of_a_line_of_38400_baud() {
    for (transform, len, time) in [(false, 14, 36), (true, 52, 135)] {
        assert_eq!(timing::printed_request_len(transform), len);
        assert_eq!(tenths(timing::transmission_time(len, 38_400)), time);
        assert_ne!(tenths(timing::transmission_time(len, 19_200)), time);
    }
}

#[test]
fn the_longest_messages_are_longer_than_the_source_counts() {
    let default = Framing::DEFAULT;
    assert_eq!(timing::max_request_len(false, default), 16);
    assert_eq!(timing::max_request_len(true, default), 64);
    assert_eq!(timing::max_reply_len(6, default), 33);
    assert_eq!([0, 1, 2].map(|values| timing::max_reply_len(values, default)), [9, 14, 17]);

    let motion = |transform| {
        RobotMessage::Motion(Motion {
            phase: MotionPhase::Running,
            error: 0.into(),
            segment_status: 2.into(),
            segment: 0x1010,
            percent: 0x1010,
            transform,
        })
    };
    let transform = Some(Transform([0x1010; 12]));
    assert_eq!(motion(None).encoded_len(default), timing::max_request_len(false, default));
    assert_eq!(motion(transform).encoded_len(default), timing::max_request_len(true, default));
    for values in 0..=6 {
        // RY first: alone it makes the select byte a DLE.
        let order = [4, 0, 1, 2, 3, 5];
        let mut reply = Reply { exception: Exception::Other(0x10), ..Reply::NOTHING };
        for axis in &order[..values] {
            reply.values[*axis] = Some(0x1010);
        }
        let len = HostMessage::Reply(reply).encoded_len(default);
        assert_eq!(len, timing::max_reply_len(values, default), "{values} values");
    }
    let one = Framing { leading_dle: LeadingDle::One, ..default };
    let doubled = Framing { stuffed_checksum: true, ..default };
    assert_eq!([one, doubled].map(|framing| timing::max_reply_len(6, framing)), [32, 34]);
}

#[test]
fn a_segment_is_done_in_parts_of_40000_octal() {
    let fraction = |percent| {
        let motion = Motion {
            phase: MotionPhase::Running,
            error: 0.into(),
            segment_status: 2.into(),
            segment: 1,
            percent,
            transform: None,
        };
        motion.fraction()
    };
    assert_eq!([0, 0o10000, 0o20000, 0o40000].map(fraction), [0.0, 0.25, 0.5, 1.0]);
    assert_eq!([0o40001, u16::MAX].map(fraction), [1.0, 1.0], "a word above it counts as done");
}

#[test]
fn the_worst_case_fits_at_38400_baud_and_not_at_19200() {
    let worst = |baud, transform| Budget::worst_case(Cumulative, baud, transform, 6, Framing::DEFAULT);
    // 64 bytes leave less of the 28 ms than the window.
    assert_eq!(tenths(worst(38_400, true).window), 113);
    assert_eq!(worst(38_400, true).slack().map(tenths), Some(27));
    assert_eq!(worst(38_400, false).window, Duration::from_millis(15));
    assert_eq!(worst(38_400, false).slack().map(tenths), Some(64));
    assert_eq!(worst(19_200, false).slack(), None);
    // A request with a transformation alone is longer than the cycle.
    assert_eq!(worst(19_200, true).window, Duration::ZERO);
    assert_eq!(timing::transmission_time(1, 0), Duration::from_secs(10));
}

/// "Translation 32, ± 1024 mm; Rotation 182.044, ± 180 °" (§3.3.2)
#[test]
fn words_are_millimetres_and_degrees() {
    let scale = Scale::default();
    assert_eq!((scale.millimetres(i16::MIN), scale.degrees(i16::MIN)), (-1024.0, -180.0));
    assert_eq!((scale.translation(-1024.0), scale.rotation(-180.0)), (Ok(i16::MIN), Ok(i16::MIN)));
    assert_eq!((scale.translation(0.5), scale.rotation(1.0)), (Ok(16), Ok(182)));
    // To the nearest word, also at the end of the range.
    assert_eq!([0.51, 0.52, -0.52].map(|mm| scale.translation(mm)), [Ok(16), Ok(17), Ok(-17)]);
    assert_eq!(scale.translation(1023.98), Ok(32767));
    assert_eq!(scale.translation(1023.99), Err(EncodeError::Range { found: 32768 }));
    assert_eq!(scale.rotation(180.0), Err(EncodeError::Range { found: 32768 }));
    assert_eq!(scale.translation(f64::NAN), Err(EncodeError::Range { found: i32::MAX }));
    assert_eq!(scale.translation(f64::NEG_INFINITY), Err(EncodeError::Range { found: i32::MIN }));
    assert_eq!((scale.translation_saturating(1e9), scale.rotation_saturating(-1e9)), (i16::MAX, i16::MIN));
    assert_eq!(scale.translation_saturating(f64::NAN), 0);
    let error = scale.translation(1024.0).unwrap_err().to_string();
    assert_eq!(error, "32768 units do not fit a word of -32768..=32767");
}

#[test]
fn the_mode_word_is_five_bits() {
    use CoordinateFrame::{Tool, World};
    let mode = Mode::CUMULATIVE_23;
    assert_eq!((mode.accumulation(), mode.has_transform(), mode.uses_inputs()), (Cumulative, true, true));
    assert!(!mode.transform_from_joints() && mode.is_named() && !Mode(32).is_named());
    assert_eq!(mode.frame(Polarity::ToolIsOne), Tool);
    assert_eq!(mode.frame(Polarity::WorldIsOne), World);
    for polarity in [Polarity::ToolIsOne, Polarity::WorldIsOne] {
        for frame in [World, Tool] {
            assert_eq!(mode.with_frame(frame, polarity).frame(polarity), frame);
        }
    }
    assert_eq!(mode.with_accumulation(NonCumulative), Mode::NON_CUMULATIVE_22);
    let none = Mode::default().with_transform_from_joints(true);
    assert_eq!((none, none.transform_from_joints()), (Mode(8), true));
    assert_eq!(mode.with_transform(false).with_inputs(false), Mode(3));
    assert_eq!(Mode(0xE0).with_inputs(true), Mode(0xF0), "bits without a name are kept");
}

/// §3: accumulation, frame, transformation, what it is computed from, inputs.
#[test]
fn each_bit_of_the_mode_stands_for_itself_alone() {
    use CoordinateFrame::{Tool, World};
    let polarity = Polarity::ToolIsOne;
    let read = |mode: Mode| {
        [
            mode.accumulation() == Cumulative,
            mode.frame(polarity) == Tool,
            mode.has_transform(),
            mode.transform_from_joints(),
            mode.uses_inputs(),
        ]
    };
    let write = |mode: Mode, on: bool| {
        [
            mode.with_accumulation(if on { Cumulative } else { NonCumulative }),
            mode.with_frame(if on { Tool } else { World }, polarity),
            mode.with_transform(on),
            mode.with_transform_from_joints(on),
            mode.with_inputs(on),
        ]
    };
    let (none, all) = (Mode(0), Mode(0xFF));
    for (place, bit) in [1, 2, 4, 8, 16].into_iter().enumerate() {
        let (only, others) = (Mode(bit), Mode(0xFF - bit));
        let mut alone = [false; 5];
        alone[place] = true;
        assert_eq!((read(only), read(others)), (alone, alone.map(|on| !on)));
        assert_eq!((write(none, true)[place], write(none, false)[place]), (only, none));
        assert_eq!((write(all, true)[place], write(all, false)[place]), (all, others));
        assert!(only.is_named());
    }
    assert_eq!(
        [0x1F, 0x20, 0x40, 0x80, 0xFF].map(|mode| Mode(mode).is_named()),
        [true, false, false, false, false]
    );
}

#[test]
fn a_list_has_up_to_14_words() {
    let list = List::new(&[5; 14]).unwrap();
    assert_eq!(list.words(), [5; 14]);
    assert_eq!(List::new(&[5; 15]), Err(EncodeError::TooLong { found: 32, limit: 30 }));
    assert_eq!(Frame::new(&[0; 31]), Err(EncodeError::TooLong { found: 31, limit: 30 }));
}

proptest! {
    /// "Diese maximale Änderung wird auch im abbremsenden Betrieb berücksichtigt" (§9.2)
    #[test]
    fn no_speed_and_no_change_of_speed_is_above_its_limit(
        targets in prop::collection::vec(any::<[i16; 6]>(), 1..60),
        velocity in prop::array::uniform6(0..40_000u16),
        acceleration in prop::array::uniform6(0..2_000u16)
    ) {
        let limits = Limits { velocity, acceleration };
        let mut limiter = Limiter::new(limits);
        let mut last = [0; 6];
        for target in targets {
            let values = limiter.speeds(target).map(i32::from);
            for axis in 0..6 {
                prop_assert!(values[axis].abs() <= i32::from(velocity[axis]).min(32767));
                prop_assert!((values[axis] - last[axis]).abs() <= i32::from(acceleration[axis]));
            }
            last = values;
        }
    }

    #[test]
    fn an_offset_is_reached_within_the_limits_and_without_passing_it(
        targets in prop::collection::vec(-20_000..20_000i16, 1..4),
        velocity in 1..3_000u16,
        acceleration in 1..2_000u16
    ) {
        let limits = Limits { velocity: [velocity; 6], acceleration: [acceleration; 6] };
        let mut limiter = Limiter::new(limits);
        let (mut position, mut speed) = (0, 0);
        for target in targets {
            let from = position;
            let cycles = 40_000 / i32::from(velocity) + 3_000 / i32::from(acceleration) * 2 + 400;
            for _ in 0..cycles {
                let next = i32::from(limiter.positions([target; 6])[3]);
                prop_assert!((next - position).abs() <= i32::from(velocity));
                prop_assert!((next - position - speed).abs() <= i32::from(acceleration));
                let between = (from.min(target.into())..=from.max(target.into())).contains(&next);
                prop_assert!(between, "{next} is not between {from} and {target}");
                (position, speed) = (next, next - position);
            }
            prop_assert_eq!((position, limiter.is_at_rest()), (i32::from(target), true));
        }
    }

    #[test]
    fn a_target_that_moves_is_followed_within_the_limits(
        targets in prop::collection::vec(-10_000..10_000i16, 200),
        acceleration in 1..500u16
    ) {
        let limits = Limits { velocity: [700; 6], acceleration: [acceleration; 6] };
        let mut limiter = Limiter::new(limits);
        let (mut position, mut speed) = (0, 0);
        for target in targets {
            let next = i32::from(limiter.positions([target; 6])[0]);
            prop_assert!((next - position).abs() <= 700);
            prop_assert!((next - position - speed).abs() <= i32::from(acceleration));
            (position, speed) = (next, next - position);
        }
    }
}

#[test]
fn an_axis_without_acceleration_stays() {
    let limits = Limits { acceleration: [0; 6], ..Limits::NONE };
    let mut limiter = Limiter::new(limits);
    assert_eq!(limiter.speeds([100; 6]), [0; 6]);
    assert_eq!(limiter.positions([100; 6]), [0; 6]);
    assert_eq!(Limiter::new(Limits::NONE).speeds([i16::MIN; 6]), [-32767; 6]);
    assert_eq!(
        Limiter::new(Limits::NONE).positions([32767, -32767, 0, 1, -1, 80]),
        [32767, -32767, 0, 1, -1, 80]
    );
}

#[test]
fn a_rejected_offset_is_taken_back() {
    let mut limiter = Limiter::new(Limits { velocity: [50; 6], acceleration: [20; 6] });
    assert_eq!([(); 3].map(|()| limiter.positions([500; 6])[0]), [20, 60, 110]);
    assert!(!limiter.is_at_rest());
    limiter.rejected();
    assert_eq!((limiter.position()[0], limiter.is_at_rest()), (60, true));
    assert_eq!(limiter.positions([500; 6])[0], 80);
    limiter.restart();
    assert_eq!(
        (limiter.position(), *limiter.limits()),
        ([0; 6], Limits { velocity: [50; 6], acceleration: [20; 6] })
    );
}

#[test]
fn an_axis_that_must_wait_stays_on_the_path() {
    let mut limiter = Limiter::new(Limits { velocity: [50; 6], acceleration: [20; 6] });
    assert_eq!(limiter.positions([500; 6])[..2], [20, 20]);
    limiter.hold(0b10);
    assert_eq!(limiter.positions([500; 6])[..3], [60, 20, 60]);
}

#[test]
fn what_leads_out_of_reach_ends_at_it_and_all_else_is_as_it_was() {
    let reach = Reach { low: [-150; 6], high: [200; 6] };
    assert_eq!(reach.offsets([-151, -150, 7, 0, 200, 201]), [-150, -150, 7, 0, 200, 200]);
    // With this acceleration any speed stops at once.
    let speeds = reach.speeds([190, -140, 190, 0, 210, -160], [30, -30, -30, 30, 30, -30], &[1000; 6]);
    assert_eq!(speeds, [10, -10, -30, 30, 0, 0]);
}
