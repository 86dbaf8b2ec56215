//! Numbers as people read them: three significant digits.

/// `x` with three significant digits; exponents only where zeros would hide it.
pub(super) fn significant(x: f64) -> String {
    if !x.is_finite() {
        return "-".to_owned();
    }
    if x.abs() < f64::MIN_POSITIVE {
        return "0".to_owned();
    }
    // The exponent after rounding: 0.9996 is 1.00.
    let scientific = format!("{x:.2e}");
    let exponent: i32 = scientific
        .rsplit_once('e')
        .and_then(|(_, e)| e.parse().ok())
        .unwrap_or(0);
    match exponent {
        -4..=2 => format!("{x:.*}", usize::try_from(2 - exponent).unwrap_or(0)),
        3..=5 => format!("{x:.0}"),
        _ => scientific,
    }
}

/// The same with a sign always.
pub(super) fn signed(x: f64) -> String {
    let text = significant(x);
    if x > 0.0 { format!("+{text}") } else { text }
}

/// A drawn value: as many decimals as it needs, three at most.
pub(super) fn drawn(x: f64) -> String {
    let text = format!("{x:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    match text {
        "-0" => "0".to_owned(),
        _ => text.to_owned(),
    }
}

/// A value to the second digit of its standard error; as [`drawn`] where there is none.
pub(super) fn valued(x: f64, sigma: Option<f64>) -> String {
    match sigma {
        Some(sigma) if sigma.is_finite() && sigma > 0.0 => {
            let decimals = (1.0 - sigma.log10().floor()).clamp(0.0, 9.0) as usize;
            format!("{x:.decimals$}")
        }
        _ => drawn(x),
    }
}

/// Unit in which people read an SI unit, and the factor to it.
pub(super) fn shown(unit: &str) -> (&str, f64) {
    match unit {
        "m" => ("mm", 1e3),
        "rad" => ("deg", 1.0_f64.to_degrees()),
        other => (other, 1.0),
    }
}

/// `3 rows (2, 5, 9)`, the first dozen of many.
pub(super) fn row_list(rows: &[usize]) -> String {
    let shown: Vec<String> = rows.iter().take(12).map(usize::to_string).collect();
    let noun = if rows.len() == 1 { "row" } else { "rows" };
    let more = if rows.len() > 12 { ", ..." } else { "" };
    format!("{} {noun} ({}{more})", rows.len(), shown.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_digits_whatever_the_size() {
        let table = [
            (0.0, "0"),
            (0.848_34, "0.848"),
            (0.999_6, "1.00"),
            (12.345, "12.3"),
            (-123.45, "-123"),
            (4321.0, "4321"),
            (3.1e-4, "0.000310"),
            (3.1e-5, "3.10e-5"),
            (f64::NAN, "-"),
        ];
        for (x, text) in table {
            assert_eq!(significant(x), text);
        }
        assert_eq!(signed(0.5), "+0.500");
        assert_eq!(drawn(-90.0), "-90");
        assert_eq!(drawn(-1e-9), "0");
    }
}
