//! The little that is changed in generated text, and what is read from it.

/// Whether a letter can be part of a name.
fn is_name(letter: char) -> bool {
    letter.is_ascii_alphanumeric() || letter == '_'
}

/// Replaces a name wherever it stands by itself.
pub fn rename(text: &str, from: &str, to: &str) -> String {
    let mut renamed = String::with_capacity(text.len());
    let mut rest = text;
    let mut before = ' ';
    while let Some(place) = rest.find(from) {
        let last = rest[..place].chars().next_back().unwrap_or(before);
        let after = rest[place + from.len()..].chars().next().unwrap_or(' ');
        renamed.push_str(&rest[..place]);
        renamed.push_str(if is_name(last) || is_name(after) {
            from
        } else {
            to
        });
        rest = &rest[place + from.len()..];
        before = from.chars().next_back().unwrap_or(' ');
    }
    renamed + rest
}

/// Whether a name stands anywhere in the text.
pub fn has_name(text: &str, name: &str) -> bool {
    rename(text, name, "") != text
}

/// The last name before `mark`, on the same line: what `mark` annotates.
pub fn name_before(text: &str, mark: &str) -> Option<String> {
    let place = text.find(mark)?;
    let line = text[..place].rsplit('\n').next()?;
    // Of `uint a[4] : register(..)` the name is `a`.
    let line = line.trim_end();
    let line = if line.ends_with(']') {
        &line[..line.rfind('[')?]
    } else {
        line
    };
    let name = line
        .rsplit(|letter| !is_name(letter))
        .find(|name| !name.is_empty())?;
    Some(name.to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_whole_names_are_renamed() {
        assert_eq!(rename("a ab a_ (a)a", "a", "x"), "x ab a_ (x)x");
        assert!(has_name("f(b)", "b"));
        assert!(!has_name("f(bc)", "b"));
    }

    #[test]
    fn the_name_before_a_mark_is_found() {
        assert_eq!(
            name_before(
                "float4 a;\nTexture2D<float4> src : register(t0);",
                " : register(t0)"
            )
            .unwrap(),
            "src"
        );
        assert_eq!(
            name_before("device T const& in_ [[buffer(1)]]", " [[buffer(1)]]").unwrap(),
            "in_"
        );
        assert_eq!(
            name_before("uint a[4] : register(b0)", " : register(b0)").unwrap(),
            "a"
        );
        assert_eq!(name_before("x", "y"), None);
    }
}
