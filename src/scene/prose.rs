//! Text of generated pages.

/// Lines of at most so many columns.
pub fn filled(text: &str, columns: usize) -> String {
    let (mut lines, mut line) = (String::new(), String::new());
    for word in text.split_whitespace() {
        if !line.is_empty() && line.chars().count() + 1 + word.chars().count() > columns {
            lines += &(std::mem::take(&mut line) + "\n");
        }
        line += if line.is_empty() { "" } else { " " };
        line += word;
    }
    lines + &line + "\n"
}

/// A paragraph of lines of at most 100 columns, with an empty one before.
pub fn paragraph(text: &str) -> String {
    format!("\n{}", filled(text, 100))
}
