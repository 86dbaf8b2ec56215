//! Tail probabilities.

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

#[cfg(test)]
mod tests {
    use super::{ln_best_of, ln_chi_square, ln_normal};

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
}
