//! The little that is changed in generated text, and what is read from it.

use std::collections::{HashMap, HashSet};
use std::iter;

/// Whether a letter can be part of a name.
fn is_name(letter: char) -> bool {
    letter.is_ascii_alphanumeric() || letter == '_'
}

/// The names, and the words and numbers, of a text, each with what follows it up to the next one. The first one is empty
/// where the text begins with something else.
fn names(text: &str) -> impl Iterator<Item = (&str, &str)> {
    // Letters of names are bytes, and what is beside them is none of theirs: texts are cut between whole letters.
    let is_letter = |byte: &u8| byte.is_ascii_alphanumeric() || *byte == b'_';
    let mut rest = text;
    iter::from_fn(move || {
        if rest.is_empty() {
            return None;
        }
        let bytes = rest.as_bytes();
        let end = bytes
            .iter()
            .position(|it| !is_letter(it))
            .unwrap_or(bytes.len());
        let next = bytes[end..]
            .iter()
            .position(is_letter)
            .map_or(bytes.len(), |gap| end + gap);
        let (name, gap) = (&rest[..end], &rest[end..next]);
        rest = &rest[next..];
        Some((name, gap))
    })
}

/// Takes the underscores away from names that end in one, where `renamed` has another name for them.
pub fn without_underscores(text: &str, renamed: &HashMap<String, &str>) -> String {
    let mut all = String::with_capacity(text.len());
    for (name, gap) in names(text) {
        let other = match name.as_bytes().last() {
            Some(b'_') => renamed.get(name).copied(),
            _ => None,
        };
        all.push_str(other.unwrap_or(name));
        all.push_str(gap);
    }
    all
}

/// The name that the text ends in.
pub fn name_at_end(text: &str) -> &str {
    &text[text.trim_end_matches(is_name).len()..]
}

/// Where the bracket is that closes the one before the text.
pub fn closing(text: &str) -> Option<usize> {
    let mut depth = 0_u32;
    text.bytes().position(|byte| {
        match byte {
            b'(' | b'[' | b'{' => depth += 1,
            b')' | b']' | b'}' if depth == 0 => return true,
            b')' | b']' | b'}' => depth -= 1,
            _ => {}
        }
        false
    })
}

/// Replaces a name wherever it stands by itself.
pub fn rename(text: &str, from: &str, to: &str) -> String {
    let mut all = String::with_capacity(text.len());
    for (name, gap) in names(text) {
        all.push_str(if name == from { to } else { name });
        all.push_str(gap);
    }
    all
}

/// All names that stand anywhere in the text and end in a digit.
pub fn numbered_names(text: &str) -> HashSet<&str> {
    let ends_in_digit = |name: &&str| name.as_bytes().last().is_some_and(u8::is_ascii_digit);
    names(text)
        .map(|(name, _)| name)
        .filter(ends_in_digit)
        .collect()
}

/// Puts `f` after decimal fractions that have no suffix, and makes the `L` of whole numbers `LL`: with
/// one DXC takes 32 of their bits (`tests/upstream/dxc-long-literal`).
pub fn suffixed(text: &str) -> String {
    let mut all = String::with_capacity(text.len() + text.len() / 32);
    for line in text.split_inclusive('\n') {
        let (code, comment) = line.split_at(line.find("//").unwrap_or(line.len()));
        let mut rest = code;
        let mut before = ' ';
        while let Some(letter) = rest.chars().next() {
            let length = if letter.is_ascii_digit() && !is_name(before) {
                number(rest)
            } else {
                letter.len_utf8()
            };
            let (token, after) = rest.split_at(length);
            all.push_str(token);
            let is_fraction =
                token.contains(['.', 'e']) && token.starts_with(|c: char| c.is_ascii_digit());
            let is_number = token.starts_with(|c: char| c.is_ascii_digit());
            if is_fraction && length > 1 && !after.starts_with(is_name) {
                all.push('f');
            }
            before = token.chars().next_back().unwrap_or(' ');
            rest = after;
            if is_number && !is_fraction {
                for suffix in ["uL", "L"] {
                    if let Some(after) = rest.strip_prefix(suffix)
                        && !after.starts_with(is_name)
                    {
                        all.push_str(suffix);
                        all.push('L');
                        before = 'L';
                        rest = after;
                        break;
                    }
                }
            }
        }
        all.push_str(comment);
    }
    all
}

/// Bytes of the decimal number that `text` begins with: digits, a fraction, an exponent.
fn number(text: &str) -> usize {
    let digits = |from: usize| text[from..].bytes().take_while(u8::is_ascii_digit).count();
    let mut length = digits(0);
    if text[length..].starts_with('.') {
        length += 1;
        length += digits(length);
    }
    if text[length..].starts_with('e') {
        let sign = usize::from(text[length + 1..].starts_with(['+', '-']));
        let exponent = digits(length + 1 + sign);
        if exponent > 0 {
            length += 1 + sign + exponent;
        }
    }
    length
}

/// Whether a name stands anywhere in the text.
pub fn has_name(text: &str, name: &str) -> bool {
    names(text).any(|(it, _)| it == name)
}

/// Puts `precise` before what functions declare of the types `scalars` and of the vectors and
/// matrices that are named after those. Members of structures and parameters stay as they are:
/// neither computes anything.
pub fn precise(text: &str, scalars: &[&str]) -> String {
    let is_float = |ty: &str| {
        let stem = ty.trim_end_matches(|letter: char| letter.is_ascii_digit() || letter == 'x');
        scalars.contains(&stem)
    };
    let mut marked = String::with_capacity(text.len() + text.len() / 8);
    let mut in_function = false;
    for line in text.lines() {
        let statement = line.trim_start();
        let indent = line.len() - statement.len();
        if indent == 0 {
            in_function = match statement {
                "{" => true,
                _ if statement.starts_with('}') => false,
                _ => statement.ends_with(") {") || in_function,
            };
        }
        let declares = statement
            .split_once(' ')
            .is_some_and(|(ty, rest)| is_float(ty) && rest.starts_with(is_name));
        marked.push_str(&line[..indent]);
        if in_function && indent > 0 && declares && statement.ends_with(';') {
            marked.push_str("precise ");
        }
        marked.push_str(statement);
        marked.push('\n');
    }
    marked
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
        assert_eq!(rename(".é1_ 1_", "1_", "x"), ".éx x");
        assert_eq!(
            without_underscores(
                "(a1_, b1_) a1",
                &HashMap::from([("a1_".into(), "b1"), ("b1_".into(), "a1")])
            ),
            "(b1, a1) a1"
        );
        assert!(has_name("f(b)", "b"));
        assert!(!has_name("f(bc)", "b"));
    }

    #[test]
    fn fractions_get_a_suffix_and_nothing_else_does() {
        assert_eq!(
            suffixed("a1.x = 1.5 * 2 - 1e25 + 3u; // 1.5\nb = x2e3(0.5L, 1.0f, 7, 2.5e-7, 1e-3)\n"),
            "a1.x = 1.5f * 2 - 1e25f + 3u; // 1.5\nb = x2e3(0.5L, 1.0f, 7, 2.5e-7f, 1e-3f)\n"
        );
    }

    #[test]
    fn long_numbers_are_as_long_as_they_say() {
        assert_eq!(
            suffixed(
                "a = (x + 13787848793156543929uL) >> 7u; b = (-9223372036854775807L - 1L) * 2.5L;\n"
            ),
            "a = (x + 13787848793156543929uLL) >> 7u; b = (-9223372036854775807LL - 1LL) * 2.5L;\n"
        );
    }

    #[test]
    fn only_variables_of_functions_become_precise() {
        let text = "\
struct Pair {
    float x;
};
cbuffer settings : register(b0) { Pair settings; }

Pair make(float a) {
    Pair ret = (Pair)0;
    float2x2 m;
    return ret;
}

[numthreads(64, 1, 1)]
void main(uint3 id : SV_DispatchThreadID)
{
    uint n = 2;
    if ((n < 2u)) {
        float rounded = (a + b);
        floating t = other;
        double4 sum[2];
        float(1.0);
    }
}
";
        let expected = text
            .replace("    float2x2", "    precise float2x2")
            .replace("    float rounded", "    precise float rounded")
            .replace("    double4", "    precise double4");
        assert_eq!(precise(text, &["float", "double"]), expected);
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
