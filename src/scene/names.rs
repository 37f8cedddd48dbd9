//! Characters that show nothing by themselves but change how the text around them is shown.

/// Whether a character controls a terminal, breaks a line or turns the direction of writing.
fn is_hidden(c: char) -> bool {
    let turns = matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    c.is_control() || turns || matches!(c, '\u{2028}' | '\u{2029}')
}

/// The first hidden character of a text, as `U+202E`.
pub fn hidden(text: &str) -> Option<String> {
    text.chars().find(|c| is_hidden(*c)).map(|c| format!("U+{:04X}", u32::from(c)))
}

/// A text with its hidden characters spelled out, for terminals.
pub fn shown(text: &str) -> String {
    let spelled = |c: char| if is_hidden(c) { c.escape_unicode().to_string() } else { c.to_string() };
    text.chars().map(spelled).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hidden_characters_are_found_and_spelled_out() {
        for plain in ["water", "вода", "水", "👩‍🔬 jelly", "ماء", "a b", ""] {
            assert_eq!((hidden(plain), shown(plain).as_str()), (None, plain));
        }
        for (text, code) in
            [("a\u{202e}b", "U+202E"), ("a\nb", "U+000A"), ("\u{1b}[2J", "U+001B"), ("\u{9b}", "U+009B")]
        {
            assert_eq!(hidden(text).as_deref(), Some(code));
            assert!(hidden(&shown(text)).is_none());
        }
        assert_eq!(shown("a\u{2067}b"), "a\\u{2067}b");
    }
}
