//! Text of others on a terminal.

use std::borrow::Cow;
use std::fmt::Write as _;

/// The text with all characters that steer a terminal, or turn its direction of writing, spelled
/// out as `\u{1b}`. Line breaks and tabs stay.
///
/// # Examples
/// ```
/// assert_eq!(hankel_system::text::visible("\u{1b}[2J red"), "\\u{1b}[2J red");
/// assert_eq!(hankel_system::text::visible("two\nlines"), "two\nlines");
/// ```
#[must_use]
pub fn visible(text: &str) -> Cow<'_, str> {
    if !text.chars().any(steers) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if steers(c) {
            // Writing to a string does not fail.
            let _ = write!(shown, "{}", c.escape_default());
        } else {
            shown.push(c);
        }
    }
    Cow::Owned(shown)
}

/// Control characters, and those of Unicode that embed or override the direction of text.
fn steers(c: char) -> bool {
    (c.is_control() && !matches!(c, '\n' | '\t'))
        || matches!(c, '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_steers_a_terminal_is_spelled_out() {
        for (text, shown) in [
            ("plain", "plain"),
            ("a\tb\nc", "a\tb\nc"),
            ("\u{1b}]0;title\u{7}", "\\u{1b}]0;title\\u{7}"),
            ("over\rwritten", "over\\rwritten"),
            ("\u{9b}31m", "\\u{9b}31m"),
            ("a\u{202e}b", "a\\u{202e}b"),
            ("größer ≥ 1", "größer ≥ 1"),
        ] {
            assert_eq!(visible(text), shown);
        }
    }
}
