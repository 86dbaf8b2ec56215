//! Square roots and whole parts in single precision, in integers, are those of the machine.

use truepose::Scalar;

#[test]
fn a_square_root_is_the_nearest_number_to_it() {
    let check = |x: f32| {
        let (found, wanted) = (x.root(), x.sqrt());
        assert!(
            found.to_bits() == wanted.to_bits() || found.is_nan() && wanted.is_nan(),
            "{x:e}: {found:e}, not {wanted:e}"
        );
    };
    // Every number of a stretch over which mantissa and the exponent's last bit take all values
    // would be 2^24; every 37th, and every exponent.
    for bits in (0x3F80_0000..0x4080_0000_u32).step_by(37) {
        check(f32::from_bits(bits));
    }
    for bits in (0..=u32::MAX).step_by(10_007) {
        check(f32::from_bits(bits));
    }
    // Around squares, where halfway is closest, and around the powers of two.
    for root in (1..5000_u16).map(f32::from) {
        let square = (root * root).to_bits();
        (square - 2..=square + 2).for_each(|bits| check(f32::from_bits(bits)));
    }
    for exponent in 0..=255_u32 {
        let power = exponent << 23;
        let around = power.saturating_sub(3)..=power + 3;
        around.for_each(|bits| check(f32::from_bits(bits)));
    }
    for x in [0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, -1.0] {
        check(x);
    }
}

#[test]
fn the_whole_part_is_the_largest_integer_below() {
    for bits in (0..=u32::MAX).step_by(10_007) {
        let x = f32::from_bits(bits);
        if x.is_finite() {
            assert!((x.whole() - x.floor()).abs() <= 0.0, "{x:e}");
            let x = f64::from(x);
            assert!((x.whole() - x.floor()).abs() <= 0.0, "{x:e}");
        }
    }
}
