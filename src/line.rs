//! Text from outside on a line of a log: it must not end the line, nor speak to the terminal.

use std::borrow::Cow;

/// The text with everything written out that would break the line, steer a terminal or turn the reading direction.
pub fn one_line(text: &str) -> Cow<'_, str> {
    if !text.chars().any(steers) {
        return Cow::Borrowed(text);
    }
    let mut line = String::with_capacity(text.len());
    for letter in text.chars() {
        if steers(letter) { line.extend(letter.escape_default()) } else { line.push(letter) }
    }
    Cow::Owned(line)
}

fn steers(letter: char) -> bool {
    letter.is_control()
        || matches!(letter, '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_from_outside_neither_end_a_line_nor_steer_a_terminal() {
        let text = "a\ncounts {}\r\x1b[2J\u{9b}31m\0\u{2028}\u{202e}b";
        assert_eq!(one_line(text), "a\\ncounts {}\\r\\u{1b}[2J\\u{9b}31m\\u{0}\\u{2028}\\u{202e}b");
    }

    #[test]
    fn usual_names_are_left_alone() {
        for text in ["camera_depth_optical_frame", "Küche/α β", "\\n \"quoted\""] {
            assert!(matches!(one_line(text), Cow::Borrowed(same) if same == text));
        }
    }
}
