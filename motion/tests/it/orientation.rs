//! Unit quaternions: their length, their sign, and where they become W P R straight up.

use cellwire_motion::Quaternion;

fn close<const N: usize>(found: [f64; N], expected: [f64; N], within: f64) {
    let far = found.iter().zip(expected).any(|(a, b)| (a - b).abs() > within || a.is_nan());
    assert!(!far, "found {found:?}, expected {expected:?}");
}

#[test]
fn four_numbers_become_a_quaternion_of_length_one() {
    close(Quaternion::normalised([2.0, -4.0, 4.0, 8.0]).to_array(), [0.2, -0.4, 0.4, 0.8], 1e-15);
    assert_eq!(Quaternion::normalised([0.0, 0.0, f64::INFINITY, 0.0]), Quaternion::IDENTITY);
}

#[test]
fn the_nearer_sign_is_that_of_every_part() {
    for part in 0..4 {
        let mut numbers = [0.0; 4];
        numbers[part] = 1.0;
        let one = Quaternion::normalised(numbers);
        let opposite = Quaternion::normalised(numbers.map(|number: f64| -number));
        assert_eq!(one.near(opposite), opposite, "part {part}");
        assert_eq!(opposite.near(one), one, "part {part}");
        assert_eq!(one.near(one), one, "part {part}");
    }
}

#[test]
fn r_is_0_within_a_thousandth_of_a_degree_of_straight_up() {
    for up in [1.0, -1.0] {
        let shown = |p: f64| Quaternion::from_wpr([0.0, p * up, 30.0]).to_wpr();
        close(shown(89.998), [0.0, 89.998 * up, 30.0], 1e-5);
        close(shown(89.9995), [-30.0 * up, 90.0 * up, 0.0], 1e-3);
    }
}
