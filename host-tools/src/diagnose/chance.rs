//! Tail probabilities, in logarithms: strong effects reach 1e-1000.

/// Natural logarithm of the probability that chi-square with `freedom` degrees of freedom
/// exceeds `x`. Abramowitz and Stegun 26.4.19 with 6.5.29 (series) and 6.5.31 (continued
/// fraction, Lentz's method); relative error of the logarithm below 1e-10.
pub(crate) fn ln_chi_square(x: f64, freedom: f64) -> f64 {
    if x.is_nan() || x <= 0.0 || freedom <= 0.0 {
        return 0.0;
    }
    let (a, h) = (0.5 * freedom, 0.5 * x);
    let front = a * h.ln() - h - libm::lgamma(a);
    if h < a + 1.0 {
        let (mut term, mut sum) = (1.0 / a, 1.0 / a);
        for n in 1..2000 {
            term *= h / (a + f64::from(n));
            sum += term;
            if term < sum * 1e-16 {
                break;
            }
        }
        let below = (front + sum.ln()).exp();
        return (-below.min(1.0)).ln_1p();
    }
    let mut b = h + 1.0 - a;
    let mut c = f64::MAX;
    let mut d = 1.0 / b;
    let mut fraction = d;
    for n in 1..2000 {
        let n = f64::from(n);
        let step = n * (a - n);
        b += 2.0;
        d = 1.0 / (step * d + b);
        c = b + step / c;
        let change = c * d;
        fraction *= change;
        if (change - 1.0).abs() < 1e-15 {
            break;
        }
    }
    front + fraction.ln()
}

/// Natural logarithm of the probability that a standard normal number exceeds `z`.
pub(crate) fn ln_normal(z: f64) -> f64 {
    let both = ln_chi_square(z * z, 1.0);
    if z > 0.0 {
        both - std::f64::consts::LN_2
    } else {
        (-0.5 * both.exp()).ln_1p()
    }
}

/// Natural logarithm of the chance that the best of `count` independent tests is this good:
/// 1 - (1 - p)^count.
pub(crate) fn ln_best_of(ln_p: f64, count: usize) -> f64 {
    let count = count as f64;
    if ln_p < -30.0 {
        return (ln_p + count.ln()).min(0.0);
    }
    let none = count * (-ln_p.exp()).ln_1p();
    (-none.exp_m1()).ln()
}

/// Natural logarithm of the probability that an F statistic with `numerator` and
/// `denominator` degrees of freedom exceeds `f`.
///
/// `P = I_x(d/2, n/2)` with `x = d / (d + n f)`, the regularised incomplete beta function by
/// its continued fraction (Abramowitz and Stegun 26.5.8, Lentz's method); relative error of
/// the logarithm below 1e-10.
pub(crate) fn ln_p_of_f(f: f64, numerator: f64, denominator: f64) -> f64 {
    if f.is_nan() || f <= 0.0 || numerator <= 0.0 || denominator <= 0.0 {
        return 0.0;
    }
    let x = denominator / (denominator + numerator * f);
    let y = numerator * f / (denominator + numerator * f);
    ln_beta_ratio(x, y, denominator / 2.0, numerator / 2.0)
}

/// ln I_x(a, b), `y = 1 - x` given apart so that neither end loses digits.
fn ln_beta_ratio(x: f64, y: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 {
        return f64::NEG_INFINITY;
    }
    if y <= 0.0 {
        return 0.0;
    }
    let front = libm::lgamma(a + b) - libm::lgamma(a) - libm::lgamma(b) + a * x.ln() + b * y.ln();
    if x < (a + 1.0) / (a + b + 2.0) {
        front + (fraction(x, a, b) / a).ln()
    } else {
        let complement = (front + (fraction(y, b, a) / b).ln()).exp();
        (-complement.min(1.0)).ln_1p()
    }
}

/// Continued fraction of the incomplete beta function.
fn fraction(x: f64, a: f64, b: f64) -> f64 {
    const TINY: f64 = 1e-300;
    let guard = |v: f64| if v.abs() < TINY { TINY } else { v };
    let mut c = 1.0;
    let mut d = 1.0 / guard(1.0 - (a + b) * x / (a + 1.0));
    let mut h = d;
    for m in 1..500 {
        let m = f64::from(m);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        d = 1.0 / guard(1.0 + even * d);
        c = guard(1.0 + even / c);
        h *= d * c;
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        d = 1.0 / guard(1.0 + odd * d);
        c = guard(1.0 + odd / c);
        let step = d * c;
        h *= step;
        if (step - 1.0).abs() < 1e-13 {
            break;
        }
    }
    h
}

#[cfg(test)]
mod tests {
    use super::{ln_best_of, ln_chi_square, ln_normal, ln_p_of_f};

    #[test]
    fn tails_match_closed_forms() {
        // Two degrees: exp(-x/2). Four: (1 + x/2) exp(-x/2).
        for x in [1e-6, 0.3, 2.0, 7.0, 40.0, 900.0] {
            assert!((ln_chi_square(x, 2.0) + 0.5 * x).abs() < 1e-10 * (1.0 + x));
            let four = (0.5 * x).ln_1p() - 0.5 * x;
            assert!((ln_chi_square(x, 4.0) - four).abs() < 1e-10 * (1.0 + x));
        }
    }

    #[test]
    fn tails_match_tables() {
        // Abramowitz and Stegun, tables 26.8 and 26.1.
        for (x, k, p) in [
            (3.841_46, 1.0, 0.05),
            (18.3070, 10.0, 0.05),
            (149.449, 100.0, 0.001),
        ] {
            assert!((ln_chi_square(x, k).exp() - p).abs() < 1e-5 * p + 1e-7);
        }
        assert!((ln_normal(1.959_964).exp() - 0.025).abs() < 1e-7);
        assert!((ln_normal(-1.0).exp() - 0.841_344_7).abs() < 1e-6);
    }

    #[test]
    fn best_of_many_is_bonferroni_where_chances_are_small() {
        assert!((ln_best_of(0.1_f64.ln(), 2).exp() - 0.19).abs() < 1e-12);
        assert!((ln_best_of(-50.0, 100) - (-50.0 + 100.0_f64.ln())).abs() < 1e-9);
    }

    #[test]
    fn f_tail_matches_tables() {
        // Upper points of the F distribution, Abramowitz and Stegun table 26.9, 4 digits.
        for (f, n, d, p) in [
            (4.0847, 1.0, 40.0, 0.05_f64),
            (3.1504, 2.0, 60.0, 0.05),
            (4.9774, 2.0, 60.0, 0.01),
            (2.9130, 12.0, 10.0, 0.05),
        ] {
            let found = ln_p_of_f(f, n, d).exp();
            assert!((found - p).abs() < 0.004 * p + 0.0004, "{f} {found}");
        }
        // exact where the numerator has two degrees: P = (1 + 2 f / d)^(-d/2)
        for (f, d) in [
            (0.01_f64, 30.0_f64),
            (1.0, 7.0),
            (900.0, 500.0),
            (1e5, 4000.0),
        ] {
            let exact = -d / 2.0 * (2.0 * f / d).ln_1p();
            assert!((ln_p_of_f(f, 2.0, d) - exact).abs() < 1e-9 * exact.abs() + 1e-12);
        }
    }
}
