//! Expands a source's own `macro_rules!`.

use std::collections::BTreeMap;

use proc_macro2::{Delimiter, Group, Ident, Spacing, TokenStream, TokenTree};
use syn::parse::{ParseStream, Parser};

/// The rules of a macro: matcher and transcriber of each.
#[derive(Clone, Debug)]
pub struct Rules(Vec<(Vec<Pattern>, Vec<TokenTree>)>);

#[derive(Clone, Debug)]
enum Pattern {
    /// `$name:kind`
    Fragment(String, String),
    /// `$( … ) separator *`
    Repeat(Vec<Pattern>, Option<char>, char),
    /// Tokens in brackets.
    Group(Delimiter, Vec<Pattern>),
    /// Any other token.
    Token(String),
}

/// What a name stands for.
#[derive(Clone, Debug)]
enum Bound {
    One(TokenStream),
    Many(Vec<BTreeMap<String, Bound>>),
}

type Bindings = BTreeMap<String, Bound>;

impl Rules {
    /// Reads the body of a `macro_rules!`.
    pub fn parse(tokens: TokenStream) -> Result<Self, String> {
        let all: Vec<TokenTree> = tokens.into_iter().collect();
        let mut rules = Vec::new();
        let mut rest = all.as_slice();
        while !rest.is_empty() {
            match rest {
                [
                    TokenTree::Group(matcher),
                    TokenTree::Punct(a),
                    TokenTree::Punct(b),
                    TokenTree::Group(body),
                    tail @ ..,
                ] if a.as_char() == '=' && b.as_char() == '>' => {
                    rules.push((
                        patterns(&matcher.stream().into_iter().collect::<Vec<_>>())?,
                        body.stream().into_iter().collect(),
                    ));
                    rest = match tail {
                        [TokenTree::Punct(p), tail @ ..] if p.as_char() == ';' => tail,
                        _ => tail,
                    };
                }
                _ => return Err("a rule of this macro cannot be read".into()),
            }
        }
        Ok(Self(rules))
    }

    /// The first rule that fits, expanded.
    pub fn expand(&self, input: &TokenStream) -> Result<TokenStream, String> {
        for (matcher, body) in &self.0 {
            let mut bound = Bindings::new();
            if let Some(rest) = fit(matcher, input.clone(), &mut bound)
                && rest.is_empty()
            {
                return transcribe(body, &bound);
            }
        }
        Err("no rule of the macro fits".into())
    }
}

fn patterns(tokens: &[TokenTree]) -> Result<Vec<Pattern>, String> {
    let mut all = Vec::new();
    let mut rest = tokens;
    loop {
        rest = match rest {
            [] => return Ok(all),
            [
                TokenTree::Punct(d),
                TokenTree::Ident(name),
                TokenTree::Punct(c),
                TokenTree::Ident(kind),
                tail @ ..,
            ] if d.as_char() == '$' && c.as_char() == ':' => {
                all.push(Pattern::Fragment(name.to_string(), kind.to_string()));
                tail
            }
            [TokenTree::Punct(d), TokenTree::Group(g), tail @ ..]
                if d.as_char() == '$' && g.delimiter() == Delimiter::Parenthesis =>
            {
                let inner = patterns(&g.stream().into_iter().collect::<Vec<_>>())?;
                let (separator, how, tail) = repetition(tail)?;
                all.push(Pattern::Repeat(inner, separator, how));
                tail
            }
            [TokenTree::Group(g), tail @ ..] => {
                let inner = patterns(&g.stream().into_iter().collect::<Vec<_>>())?;
                all.push(Pattern::Group(g.delimiter(), inner));
                tail
            }
            [token, tail @ ..] => {
                all.push(Pattern::Token(token.to_string()));
                tail
            }
        };
    }
}

/// `separator? (* | + | ?)`
fn repetition(tail: &[TokenTree]) -> Result<(Option<char>, char, &[TokenTree]), String> {
    match tail {
        [TokenTree::Punct(p), rest @ ..] if "*+?".contains(p.as_char()) => {
            Ok((None, p.as_char(), rest))
        }
        [TokenTree::Punct(s), TokenTree::Punct(p), rest @ ..] if "*+".contains(p.as_char()) => {
            Ok((Some(s.as_char()), p.as_char(), rest))
        }
        _ => Err("a repetition of this macro cannot be read".into()),
    }
}

fn split_first(stream: TokenStream) -> Option<(TokenTree, TokenStream)> {
    let mut iter = stream.into_iter();
    let first = iter.next()?;
    Some((first, iter.collect()))
}

fn fit(patterns: &[Pattern], input: TokenStream, bound: &mut Bindings) -> Option<TokenStream> {
    let Some((first, rest)) = patterns.split_first() else {
        return Some(input);
    };
    match first {
        Pattern::Token(text) => {
            let (token, tail) = split_first(input)?;
            (token.to_string() == *text).then_some(())?;
            fit(rest, tail, bound)
        }
        Pattern::Group(delimiter, inner) => {
            let (token, tail) = split_first(input)?;
            let TokenTree::Group(g) = token else {
                return None;
            };
            (g.delimiter() == *delimiter).then_some(())?;
            fit(inner, g.stream(), bound)?.is_empty().then_some(())?;
            fit(rest, tail, bound)
        }
        Pattern::Fragment(name, kind) => {
            let (own, tail) = fragment(kind, input)?;
            bound.insert(name.clone(), Bound::One(own));
            fit(rest, tail, bound)
        }
        Pattern::Repeat(inner, separator, how) => {
            let mut turns = Vec::new();
            let mut tail = input;
            loop {
                let mut own = Bindings::new();
                let start = if turns.is_empty() {
                    Some(tail.clone())
                } else if let Some(s) = separator {
                    match split_first(tail.clone()) {
                        Some((TokenTree::Punct(p), t)) if p.as_char() == *s => Some(t),
                        _ => None,
                    }
                } else {
                    Some(tail.clone())
                };
                let Some(start) = start.filter(|s| !s.is_empty()) else {
                    break;
                };
                let Some(t) = fit(inner, start, &mut own) else {
                    break;
                };
                turns.push(own);
                tail = t;
                if *how == '?' {
                    break;
                }
            }
            if *how == '+' && turns.is_empty() {
                return None;
            }
            let mut names = Vec::new();
            collect_names(inner, &mut names);
            for name in names {
                bound.insert(name, Bound::Many(turns.clone()));
            }
            fit(rest, tail, bound)
        }
    }
}

fn collect_names(patterns: &[Pattern], names: &mut Vec<String>) {
    for p in patterns {
        match p {
            Pattern::Fragment(name, _) => names.push(name.clone()),
            Pattern::Repeat(inner, ..) | Pattern::Group(_, inner) => collect_names(inner, names),
            Pattern::Token(_) => {}
        }
    }
}

fn fragment(kind: &str, input: TokenStream) -> Option<(TokenStream, TokenStream)> {
    fn parsed<T: syn::parse::Parse + quote::ToTokens>(
        input: TokenStream,
    ) -> Option<(TokenStream, TokenStream)> {
        let parser = |stream: ParseStream<'_>| {
            let own: T = stream.parse()?;
            let rest: TokenStream = stream.parse()?;
            Ok((quote::quote!(#own), rest))
        };
        parser.parse2(input).ok()
    }
    match kind {
        "tt" => {
            let (token, tail) = split_first(input)?;
            Some((token.into(), tail))
        }
        "ident" => parsed::<Ident>(input),
        "literal" => parsed::<syn::ExprLit>(input),
        "ty" => parsed::<syn::Type>(input),
        "path" => parsed::<syn::Path>(input),
        "block" => parsed::<syn::Block>(input),
        "meta" => parsed::<syn::Meta>(input),
        "expr" => {
            let (own, tail) = parsed::<syn::Expr>(input)?;
            let group = Group::new(Delimiter::None, own);
            Some((TokenTree::Group(group).into(), tail))
        }
        _ => None,
    }
}

fn transcribe(body: &[TokenTree], bound: &Bindings) -> Result<TokenStream, String> {
    let mut out = TokenStream::new();
    let mut rest = body;
    loop {
        rest = match rest {
            [] => return Ok(out),
            [TokenTree::Punct(d), TokenTree::Ident(name), tail @ ..] if d.as_char() == '$' => {
                match bound.get(&name.to_string()) {
                    Some(Bound::One(tokens)) => out.extend(tokens.clone()),
                    Some(Bound::Many(_)) => {
                        return Err(format!("`${name}` is repeated and stands alone"));
                    }
                    // `$crate`
                    None => out.extend([TokenTree::Ident(name.clone())]),
                }
                tail
            }
            [TokenTree::Punct(d), TokenTree::Group(g), tail @ ..]
                if d.as_char() == '$' && g.delimiter() == Delimiter::Parenthesis =>
            {
                let inner: Vec<TokenTree> = g.stream().into_iter().collect();
                let (separator, _, tail) = repetition(tail)?;
                let mut used = Vec::new();
                names_used(&inner, &mut used);
                let turns = used.iter().find_map(|n| match bound.get(n) {
                    Some(Bound::Many(turns)) => Some(turns),
                    _ => None,
                });
                let turns = turns.ok_or("a repetition repeats nothing")?;
                for (i, own) in turns.iter().enumerate() {
                    if let (Some(s), true) = (separator, i > 0) {
                        let p = proc_macro2::Punct::new(s, Spacing::Alone);
                        out.extend([TokenTree::Punct(p)]);
                    }
                    let mut all = bound.clone();
                    all.extend(own.clone());
                    out.extend(transcribe(&inner, &all)?);
                }
                tail
            }
            [TokenTree::Group(g), tail @ ..] => {
                let inner: Vec<TokenTree> = g.stream().into_iter().collect();
                let mut group = Group::new(g.delimiter(), transcribe(&inner, bound)?);
                group.set_span(g.span());
                out.extend([TokenTree::Group(group)]);
                tail
            }
            [token, tail @ ..] => {
                out.extend([token.clone()]);
                tail
            }
        };
    }
}

fn names_used(tokens: &[TokenTree], names: &mut Vec<String>) {
    for pair in tokens.windows(2) {
        if let [TokenTree::Punct(d), TokenTree::Ident(name)] = pair
            && d.as_char() == '$'
        {
            names.push(name.to_string());
        }
    }
    for token in tokens {
        if let TokenTree::Group(g) = token {
            names_used(&g.stream().into_iter().collect::<Vec<_>>(), names);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn expanded(rules: &str, input: &str) -> String {
        let rules = Rules::parse(rules.parse().unwrap()).unwrap();
        let out = rules.expand(&input.parse().unwrap()).unwrap();
        // How tokens are spaced when they are printed is not what is tested.
        out.to_string().replace(' ', "")
    }

    #[test]
    fn fragments_and_repetitions_are_expanded() {
        let series =
            "($y:expr; $first:expr, $($next:expr),*) => {{ f($y * $first); $( g($next, $y); )* }};";
        assert_eq!(
            expanded(series, "a + b; 1.0, 2.0, c"),
            "{f(a+b*1.0);g(2.0,a+b);g(c,a+b);}"
        );
        let fields = "($s:ident, $($c:ident)*) => { $s { $($c: x.$c,)* } };";
        assert_eq!(expanded(fields, "Fixed, r g"), "Fixed{r:x.r,g:x.g,}");
    }
}
