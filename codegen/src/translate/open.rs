//! Specialisation constants in languages whose naga writers cannot express them: values, or named
//! constants whose declarations are replaced in the text.

use std::borrow::Cow;
use std::collections::HashMap;

use naga::valid::ModuleInfo;
use naga::{Arena, Constant, Expression, Function, Module, ScalarKind, Span, TypeInner};

use super::{Job, text, validate};
use crate::Language;
use crate::error::Failure;
use crate::manifest::macro_name;

impl Job<'_> {
    /// The module without specialisation constants: each is replaced by its value, or by a named
    /// constant if it stays open ([`Self::open_constants`]).
    pub(super) fn settled(&self) -> Result<(Cow<'_, Module>, Cow<'_, ModuleInfo>), Failure> {
        if self.stays_open() {
            let module = self.with_named_constants()?;
            let info = validate(&module, &self.kernel.name)?;
            return Ok((Cow::Owned(module), Cow::Owned(info)));
        }
        naga::back::pipeline_constants::process_overrides(
            &self.ir.module,
            &self.ir.info,
            None,
            &naga::back::PipelineConstants::default(),
        )
        .map_err(|error| self.failure(&error))
    }

    fn stays_open(&self) -> bool {
        self.options.open_constants && !self.ir.module.overrides.is_empty()
    }

    fn with_named_constants(&self) -> Result<Module, Failure> {
        let mut module = self.ir.module.clone();
        // Only those may be declared in the text.
        for (_, constant) in module.constants.iter_mut() {
            constant.name = None;
        }
        let mut constants = HashMap::new();
        for (handle, it) in self.ir.module.overrides.iter() {
            let init = it.init.ok_or_else(|| Failure {
                construct: it.name.clone(),
                message: "a specialisation constant without a default".into(),
                ..self.failure(&std::fmt::Error)
            })?;
            let constant = Constant {
                name: it.name.clone(),
                ty: it.ty,
                init,
            };
            let constant = module.constants.append(constant, Span::UNDEFINED);
            constants.insert(handle, constant);
        }
        let replace = |expressions: &mut Arena<Expression>| {
            for (_, expression) in expressions.iter_mut() {
                if let Expression::Override(handle) = *expression {
                    *expression = Expression::Constant(constants[&handle]);
                }
            }
        };
        replace(&mut module.global_expressions);
        let each = |function: &mut Function| replace(&mut function.expressions);
        module.functions.iter_mut().for_each(|(_, it)| each(it));
        module
            .entry_points
            .iter_mut()
            .for_each(|it| each(&mut it.function));
        module.overrides = Arena::new();
        Ok(module)
    }

    /// Replaces the declarations of the constants that stay open: in HLSL and GLSL by a macro that
    /// whoever includes the text may define, in MSL by a function constant.
    ///
    /// # Errors
    ///
    /// The text declares them otherwise than is expected.
    pub(super) fn open_constants(&self, source: String) -> Result<String, Failure> {
        if !self.stays_open() {
            return Ok(source);
        }
        let before = match self.language {
            Language::Hlsl => "static const",
            Language::Msl => "constant",
            _ => "const",
        };
        let module = &self.ir.module;
        let mut all = module
            .overrides
            .iter()
            .map(|(_, it)| (it, word_for(&module.types[it.ty].inner)))
            .peekable();
        let mut opened = String::with_capacity(source.len());
        for line in source.lines() {
            let declared = line
                .strip_prefix(before)
                .zip(all.peek())
                .and_then(|(it, (_, ty))| it.strip_prefix(' ')?.strip_prefix(ty)?.strip_prefix(' '))
                .and_then(|it| it.strip_suffix(';'))
                .and_then(|it| it.split_once(" = "));
            match declared.zip(declared.and_then(|_| all.next())) {
                Some(((name, value), (it, ty))) => {
                    let known = it.name.as_deref().unwrap_or(name);
                    opened.push_str(&match self.language {
                        Language::Msl => {
                            let id = it.id.unwrap_or_default();
                            function_constant(&source, ty, name, value, id)
                        }
                        _ => {
                            let given = macro_name(&self.kernel.name, known);
                            format!(
                                "#ifndef {given}\n#define {given} {value}\n#endif\n\
                                 {before} {ty} {name} = {ty}({given});\n"
                            )
                        }
                    });
                }
                None => {
                    opened.push_str(line);
                    opened.push('\n');
                }
            }
        }
        match all.next() {
            None => Ok(opened),
            Some((missing, _)) => Err(Failure {
                construct: missing.name.clone(),
                message: "the text does not declare this constant as it is expected".into(),
                ..self.failure(&std::fmt::Error)
            }),
        }
    }
}

/// A function constant with a default, in the words of Metal's specification: a function constant
/// itself has none.
fn function_constant(source: &str, ty: &str, name: &str, value: &str, id: u16) -> String {
    let mut given = format!("{name}_given");
    while text::has_name(source, &given) {
        given.push('_');
    }
    format!(
        "constant {ty} {given} [[function_constant({id})]];\n\
         constant {ty} {name} = is_function_constant_defined({given}) ? {given} : {value};\n"
    )
}

/// A scalar type's name in HLSL, GLSL and MSL.
fn word_for(ty: &TypeInner) -> &'static str {
    match ty {
        TypeInner::Scalar(scalar) => match scalar.kind {
            ScalarKind::Float => "float",
            ScalarKind::Sint => "int",
            ScalarKind::Bool => "bool",
            _ => "uint",
        },
        _ => "uint",
    }
}
