//! Numbers as people read them: tick values and short decimal forms.

/// Tick values at a step of 1, 2 or 5 times a power of ten within `lo..=hi`, at most about `wanted` of them, with
/// their labels. Empty when the range is empty or not finite.
pub fn ticks(lo: f64, hi: f64, wanted: usize) -> Vec<(f64, String)> {
    let range = hi - lo;
    if !(range > 0.0 && range.is_finite()) || wanted == 0 {
        return Vec::new();
    }
    let rough = range / wanted as f64;
    let power = 10f64.powf(rough.log10().floor());
    let step = [1.0, 2.0, 5.0, 10.0].map(|m| m * power).into_iter().find(|s| *s >= rough * 0.999);
    let Some(step) = step.filter(|s| s.is_normal()) else { return Vec::new() };
    let first = (lo / step - 1e-9).ceil();
    let last = (hi / step + 1e-9).floor();
    (0..=wanted + 1)
        .map(|i| first + i as f64)
        .take_while(|k| *k <= last)
        .map(|k| {
            let value = k * step;
            (value, tick_label(value, step))
        })
        .collect()
}

/// The value with as many decimals as the step needs.
fn tick_label(value: f64, step: f64) -> String {
    let decimals = (-step.log10() - 1e-9).ceil().max(0.0);
    if decimals > 5.0 || value.abs() >= 1e6 {
        return scientific(value);
    }
    let decimals = decimals as usize;
    // No "-0".
    format!("{:.decimals$}", if value.abs() < step / 2.0 { 0.0 } else { value })
}

/// A value with about three significant digits: `0`, `0.0123`, `4.57`, `81.3`, `1234`, `1.23e7`, `nan`.
pub fn compact(value: f64) -> String {
    let size = value.abs();
    if value.is_nan() {
        "nan".into()
    } else if value.is_infinite() {
        if value > 0.0 { "inf".into() } else { "-inf".into() }
    } else if size == 0.0 {
        "0".into()
    } else if !(1e-3..1e6).contains(&size) {
        scientific(value)
    } else if size >= 99.95 {
        format!("{value:.0}")
    } else {
        let decimals = (2.0 - size.log10().floor()).clamp(0.0, 6.0) as usize;
        let text = format!("{value:.decimals$}");
        if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
    }
}

fn scientific(value: f64) -> String {
    if value == 0.0 { "0".into() } else { format!("{value:.2e}").replace(".00e", "e") }
}

/// A count with spaces between groups of three digits: `1 234 567`.
pub fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut out = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push(' ');
        }
        out.push(digit);
    }
    out
}

/// `1 pixel`, `2 pixels`, `12 345 pixels`.
pub(crate) fn pixels(count: usize) -> String {
    format!("{} pixel{}", grouped(count as u64), if count == 1 { "" } else { "s" })
}

/// `99.9th`, `95th`, `100th`, `91st`.
pub(crate) fn ordinal(percentile: f64) -> String {
    let text = compact(percentile);
    let suffix = match (text.contains('.'), percentile as u32 % 100, percentile as u32 % 10) {
        (true, ..) | (_, 11..=13, _) => "th",
        (.., 1) => "st",
        (.., 2) => "nd",
        (.., 3) => "rd",
        _ => "th",
    };
    text + suffix
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(lo: f64, hi: f64, wanted: usize) -> Vec<String> {
        ticks(lo, hi, wanted).into_iter().map(|t| t.1).collect()
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(labels(0.0, 81.3, 5), ["0", "20", "40", "60", "80"]);
        assert_eq!(labels(-0.25, 0.25, 5), ["-0.2", "-0.1", "0.0", "0.1", "0.2"]);
        assert_eq!(labels(3.0, 4.0, 2), ["3.0", "3.5", "4.0"]);
        assert_eq!(labels(0.0, 3e6, 3), ["0", "1e6", "2e6", "3e6"]);
        assert_eq!(labels(0.0, 2e-7, 2), ["0", "1e-7", "2e-7"]);
    }

    #[test]
    fn hostile_ranges_have_no_ticks() {
        for (lo, hi) in [(1.0, 1.0), (2.0, 1.0), (f64::NAN, 1.0), (0.0, f64::INFINITY)] {
            assert!(ticks(lo, hi, 5).is_empty());
        }
        assert!(ticks(0.0, 1.0, 0).is_empty());
        assert!(ticks(-f64::from(f32::MAX), f64::from(f32::MAX), 5).len() >= 3);
        assert!(ticks(0.0, f64::MIN_POSITIVE, 5).len() <= 7);
    }

    #[test]
    fn short_numbers() {
        for (value, text) in
            [(0.0, "0"), (0.0123, "0.0123"), (4.567, "4.57"), (81.3, "81.3"), (1234.4, "1234"), (0.5, "0.5")]
        {
            assert_eq!(compact(value), text);
        }
        assert_eq!(compact(1.23e7), "1.23e7");
        assert_eq!(compact(-2e-9), "-2e-9");
        assert_eq!(compact(f64::NAN), "nan");
        assert_eq!(grouped(1_234_567), "1 234 567");
        assert_eq!(grouped(0), "0");
        assert_eq!(
            (ordinal(99.9), ordinal(91.0), ordinal(100.0)),
            ("99.9th".into(), "91st".into(), "100th".into())
        );
    }
}
