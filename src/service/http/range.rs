//! Byte ranges (RFC 9110 §14).

use std::ops::Range;

use axum::http::HeaderValue;

/// The part of a file that a request asks for.
#[derive(Debug, PartialEq, Eq)]
pub enum Selection {
    Whole,
    Part(Range<u64>),
    Unsatisfiable,
}

/// Parses a `Range` header for a file of `length` bytes. A server may always answer with the whole
/// file. This one does so for several ranges at once, for units other than bytes, and for malformed
/// headers.
pub fn select(range: Option<&HeaderValue>, length: u64) -> Selection {
    let Some(spec) = range.and_then(|value| value.to_str().ok()).and_then(|value| value.strip_prefix("bytes=")) else {
        return Selection::Whole;
    };
    let Some((first, last)) = spec.split_once('-') else { return Selection::Whole };
    let number = |text: &str| {
        let text = text.trim();
        text.bytes().all(|byte| byte.is_ascii_digit()).then(|| text.parse::<u64>().ok()).flatten()
    };
    match (first.trim().is_empty(), last.trim().is_empty()) {
        (false, false) => match (number(first), number(last)) {
            (Some(first), Some(last)) if first <= last => part(first, last.saturating_add(1), length),
            _ => Selection::Whole,
        },
        (false, true) => number(first).map_or(Selection::Whole, |first| part(first, length, length)),
        (true, false) => match number(last) {
            Some(0) => Selection::Unsatisfiable,
            Some(n) => part(length.saturating_sub(n), length, length),
            None => Selection::Whole,
        },
        (true, true) => Selection::Whole,
    }
}

fn part(start: u64, end: u64, length: u64) -> Selection {
    if start < length { Selection::Part(start..end.min(length)) } else { Selection::Unsatisfiable }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges() {
        use Selection::*;
        let cases: &[(&str, Selection)] = &[
            ("bytes=0-0", Part(0..1)),
            ("bytes=2-5", Part(2..6)),
            ("bytes=2-", Part(2..10)),
            ("bytes=-3", Part(7..10)),
            ("bytes=-30", Part(0..10)),
            ("bytes=2-99999999999", Part(2..10)),
            ("bytes=0-18446744073709551615", Part(0..10)),
            ("bytes=10-", Unsatisfiable),
            ("bytes=10-12", Unsatisfiable),
            ("bytes=-0", Unsatisfiable),
            ("bytes=5-2", Whole),
            ("bytes=0-1,4-5", Whole),
            ("bytes=-", Whole),
            ("bytes=a-b", Whole),
            ("bytes=+1-2", Whole),
            ("bytes", Whole),
            ("lines=0-1", Whole),
        ];
        for (header, expected) in cases {
            assert_eq!(select(Some(&HeaderValue::from_static(header)), 10), *expected, "{header}");
        }
        assert_eq!(select(None, 10), Whole);
        assert_eq!(select(Some(&HeaderValue::from_static("bytes=-1")), 0), Unsatisfiable);
    }
}
