//! Blocks: their statements with the comments above them, the patterns that `let` binds, and invocations of
//! macros, which become blocks.

use std::collections::HashMap;

use proc_macro2::{Span, TokenStream};
use syn::spanned::Spanned;

use super::{Done, Evaluator, Frame};
use crate::functions::fold::float;
use crate::functions::ir::{Rank, Stmt};
use crate::functions::value::Value;

impl Evaluator<'_> {
    pub(super) fn block(&mut self, frame: &mut Frame, block: &syn::Block) -> Done<Value> {
        frame.scopes.push(HashMap::new());
        let done = self.statements(frame, &block.stmts);
        frame.scopes.pop();
        done
    }

    pub(super) fn statements(&mut self, frame: &mut Frame, stmts: &[syn::Stmt]) -> Done<Value> {
        let mut last = Value::Unit;
        for stmt in stmts {
            let before = self.blocks.last().map_or(0, Vec::len);
            last = self.statement(frame, stmt)?;
            // A comment belongs to what the statement made; without that it is dropped.
            let comment = self.comment(frame, stmt.span());
            if let Some(block) = self.blocks.last_mut()
                && block.len() > before
            {
                for (i, line) in comment.into_iter().enumerate() {
                    block.insert(before + i, Stmt::Comment(line));
                }
            }
        }
        Ok(last)
    }

    /// The comment above a statement.
    fn comment(&self, frame: &Frame, span: Span) -> Vec<String> {
        let lines = &self.tree.modules[frame.module].lines;
        let mut at = span.start().line.saturating_sub(1);
        let mut found = Vec::new();
        while at > 0 {
            let Some(text) = lines.get(at - 1).map(|l| l.trim()) else {
                break;
            };
            match text.strip_prefix("//") {
                Some(rest) if !rest.starts_with(['/', '!']) => found.push(rest.trim().to_owned()),
                _ => break,
            }
            at -= 1;
        }
        found.reverse();
        found
    }

    fn statement(&mut self, frame: &mut Frame, stmt: &syn::Stmt) -> Done<Value> {
        match stmt {
            syn::Stmt::Local(l) => {
                let Some(init) = &l.init else {
                    return Err(self.refuse(
                        frame,
                        l.span(),
                        "a variable gets a value where it is declared",
                    ));
                };
                if let Some((_, other)) = &init.diverge {
                    return Err(self.refuse(frame, other.span(), "`let … else` has no form here"));
                }
                let (pat, ty) = match &l.pat {
                    syn::Pat::Type(t) => (t.pat.as_ref(), Some(t.ty.as_ref())),
                    other => (other, None),
                };
                let value = self.expr(frame, &init.expr)?;
                let value = self.typed(frame, value, ty, l.span())?;
                self.bind(frame, pat, value, Rank::Variable)?;
                Ok(Value::Unit)
            }
            syn::Stmt::Item(syn::Item::Const(c)) => {
                let value = self.expr(frame, &c.expr)?;
                let value = self.typed(frame, value, Some(&c.ty), c.span())?;
                self.declare(frame, &c.ident.to_string(), value);
                Ok(Value::Unit)
            }
            syn::Stmt::Item(item) => Err(self.refuse(
                frame,
                item.span(),
                "an item inside of a function has no form here",
            )),
            syn::Stmt::Expr(e, semicolon) => {
                let value = self.expr(frame, e)?;
                Ok(if semicolon.is_some() {
                    Value::Unit
                } else {
                    value
                })
            }
            syn::Stmt::Macro(m) => {
                let value = self.invocation(frame, &m.mac)?;
                Ok(if m.semi_token.is_some() {
                    Value::Unit
                } else {
                    value
                })
            }
        }
    }

    pub(super) fn bind(
        &mut self,
        frame: &mut Frame,
        pat: &syn::Pat,
        value: Value,
        rank: Rank,
    ) -> Done<()> {
        match pat {
            syn::Pat::Ident(p) if p.subpat.is_none() => {
                let name = p.ident.to_string();
                let value = self.settled(value, &name, rank);
                self.declare(frame, &name, value);
                Ok(())
            }
            syn::Pat::Wild(_) => Ok(()),
            syn::Pat::Paren(p) => self.bind(frame, &p.pat, value, rank),
            syn::Pat::Reference(p) => self.bind(frame, &p.pat, value, rank),
            syn::Pat::Type(p) => {
                let value = self.typed(frame, value, Some(&p.ty), p.span())?;
                self.bind(frame, &p.pat, value, rank)
            }
            syn::Pat::Tuple(p) => {
                let Value::Tuple(all) = self.read(value) else {
                    return Err(self.refuse(
                        frame,
                        p.span(),
                        "only a tuple is taken apart like this",
                    ));
                };
                // All are computed before any of them gets its name.
                let mut news = Vec::new();
                for (pat, v) in p.elems.iter().zip(all) {
                    let name = match pat {
                        syn::Pat::Ident(i) => i.ident.to_string(),
                        _ => "part".into(),
                    };
                    news.push(self.settled(v, &name, rank));
                }
                for (pat, v) in p.elems.iter().zip(news) {
                    self.bind(frame, pat, v, rank)?;
                }
                Ok(())
            }
            syn::Pat::Struct(p) => {
                let Value::Struct(_, fields) = self.read(value) else {
                    return Err(self.refuse(
                        frame,
                        p.span(),
                        "only a structure is taken apart like this",
                    ));
                };
                for field in &p.fields {
                    let syn::Member::Named(name) = &field.member else {
                        return Err(self.refuse(
                            frame,
                            field.span(),
                            "a field by number has no form here",
                        ));
                    };
                    let name = name.to_string();
                    let Some((_, v)) = fields.iter().find(|(n, _)| *n == name) else {
                        return Err(self.refuse(
                            frame,
                            field.span(),
                            format!("there is no field `{name}`"),
                        ));
                    };
                    self.bind(frame, &field.pat, v.clone(), rank)?;
                }
                Ok(())
            }
            syn::Pat::Slice(p) => {
                let Value::Array(all) = self.read(value) else {
                    return Err(self.refuse(
                        frame,
                        p.span(),
                        "only an array is taken apart like this",
                    ));
                };
                let mut all = all.into_iter();
                for pat in &p.elems {
                    if matches!(pat, syn::Pat::Rest(_)) {
                        break;
                    }
                    let Some(v) = all.next() else {
                        return Err(self.refuse(frame, pat.span(), "the array is not that long"));
                    };
                    self.bind(frame, pat, v, rank)?;
                }
                Ok(())
            }
            other => Err(self.refuse(frame, other.span(), "this pattern has no form here")),
        }
    }

    pub(super) fn invocation(&mut self, frame: &mut Frame, mac: &syn::Macro) -> Done<Value> {
        let name = mac.path.segments.last().map(|s| s.ident.to_string());
        let name = name.unwrap_or_default();
        let span = mac.path.span();
        match name.as_str() {
            "lit" => {
                let e: syn::Expr = self.parsed(frame, mac.tokens.clone(), span)?;
                let value = self.value(frame, &e)?;
                match value.as_double().or(value.as_int().map(|i| i as f64)) {
                    Some(v) => Ok(Value::Scalar(float(v as f32))),
                    None => Err(self.refuse(frame, span, "`lit!` takes a number that is known")),
                }
            }
            "unroll" => self.unroll(frame, mac),
            "assert" | "debug_assert" => Ok(Value::Unit),
            _ => {
                let Some(rules) = self.tree.rules(frame.module, &name) else {
                    return Err(self.refuse(frame, span, format!("`{name}!` has no form here")));
                };
                let tokens = rules
                    .expand(&mac.tokens)
                    .map_err(|e| self.refuse(frame, span, format!("`{name}!`: {e}")))?;
                let braced = quote::quote!({ #tokens });
                let block: syn::Block = self.parsed(frame, braced, span)?;
                self.block(frame, &block)
            }
        }
    }

    pub(super) fn parsed<T: syn::parse::Parse>(
        &self,
        frame: &Frame,
        tokens: TokenStream,
        span: Span,
    ) -> Done<T> {
        syn::parse2(tokens).map_err(|e| self.refuse(frame, span, e.to_string()))
    }
}
