//! The crate's own sine and cosine against those of the host's mathematical library in
//! double precision.

use truepose::Scalar;

/// Largest error of sine and cosine over `points` angles in [-reach, reach], each with an
/// offset from [-pi/2, pi/2] where `offsets` is set.
fn worst<T: Scalar>(reach: f64, points: u32, offsets: bool) -> f64 {
    let half = f64::from(points) / 2.0;
    let mut worst = 0.0_f64;
    for i in 0..=points {
        let x = T::of(reach * (f64::from(i) - half) / half);
        // Runs through its range many times, out of step with x.
        let share = f64::from(i % 1009) / 504.0 - 1.0;
        let offset = T::of(if offsets {
            share * core::f64::consts::FRAC_PI_2
        } else {
            0.0
        });
        let (s, c) = x.sincos_beside(offset);
        let angle = x.widen() + offset.widen();
        worst = worst
            .max((s.widen() - angle.sin()).abs())
            .max((c.widen() - angle.cos()).abs());
    }
    worst
}

#[test]
fn single_precision_is_within_one_e_minus_seven_up_to_a_hundred_radians() {
    for reach in [1e-3, 0.78, 1.6, 7.0, 100.0] {
        let error = worst::<f32>(reach, 1_000_000, false);
        assert!(error < 1.0e-7, "+-{reach} rad: {error:e}");
    }
}

#[test]
fn an_offset_costs_single_precision_less_than_one_more_rounding() {
    let error = worst::<f32>(7.0, 1_000_000, true);
    assert!(error < 1.7e-7, "{error:e}");
}

#[test]
fn a_little_turn_costs_single_precision_no_more_than_its_roundings() {
    let mut error = 0.0_f64;
    for k in -3000..=3000_i16 {
        let (angle, by) = (f32::from(k) * 1e-3, f32::from(k % 241) * 5e-4);
        let (s, c) = angle.sincos();
        let (exact_s, exact_c) = (f64::from(angle) + f64::from(by)).sin_cos();
        let (s, c) = f32::turned_by_step(s, c, by);
        error = error.max((f64::from(s) - exact_s).abs());
        error = error.max((f64::from(c) - exact_c).abs());
        let (s, c) = f64::turned_by_step(f64::from(angle).sin(), f64::from(angle).cos(), by.into());
        assert!((s - exact_s).abs() < 4e-16 && (c - exact_c).abs() < 4e-16);
    }
    assert!(error < 1.5e-7, "{error:e}");
}

#[test]
fn double_precision_is_within_three_e_minus_sixteen_up_to_a_thousand_radians() {
    for reach in [1e-6, 0.78, 7.0, 1000.0] {
        let error = worst::<f64>(reach, 200_000, false);
        assert!(error < 3.0e-16, "+-{reach} rad: {error:e}");
    }
}

#[test]
fn what_is_no_number_has_no_sine() {
    for x in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let (s, c) = x.sincos();
        assert!(s.is_nan() && c.is_nan());
        let (s, c) = f64::from(x).sincos();
        assert!(s.is_nan() && c.is_nan());
    }
}

#[test]
fn whole_quarter_turns_keep_the_sign() {
    for quarter in -8_i32..=8 {
        let angle = f64::from(quarter) * core::f64::consts::FRAC_PI_2;
        let (s, c) = f32::of(angle).sincos();
        assert!((f64::from(s) - angle.sin()).abs() < 1.0e-6);
        assert!((f64::from(c) - angle.cos()).abs() < 1.0e-6);
    }
}

#[test]
fn the_angle_of_a_sine_and_a_cosine_is_their_arc_tangent() {
    for k in -4000..=4000_i16 {
        let angle = f64::from(k) * (core::f64::consts::PI / 4000.0);
        let tiny = angle * 1e-9;
        for angle in [angle, tiny, 0.5 + tiny] {
            let (s, c) = angle.sin_cos();
            let error = (f64::angle(s, c) - s.atan2(c)).abs();
            assert!(error <= 4.5e-16 * angle.abs(), "{angle}: {error:e}");
            assert!((f32::angle(s as f32, c as f32) - angle as f32).abs() < 3e-7);
        }
    }
}
