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
        assert!(has_name("f(b)", "b"));
        assert!(!has_name("f(bc)", "b"));
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
