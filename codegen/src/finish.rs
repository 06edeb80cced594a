//! From rust-gpu's SPIR-V to the final: validated, optimised, asking for no more than it uses,
//! with the names of the source. The same bytes on every machine: the tools are compiled in.

use std::collections::BTreeMap;

use hankel_dsl::native::describe::{ConstantValue, Kernel, Role, Rounding};
use rspirv::dr::Module;
use spirv_tools::TargetEnv;
use spirv_tools::opt::{Optimizer, Passes};
use spirv_tools::val::Validator;

use crate::cost::{self, Cost};
use crate::error::{Failure, Step, guarded};
use crate::spirv::uniform::{Group, Memory};
use crate::spirv::{
    self, bounds, branches, canonical, constants, empty, exact, halves, holders, interface, libm,
    names, narrow, offsets, order, parts, references, refused, split, tables, trim, undefined,
    uniform, widths,
};
use crate::translate::reading;

/// What the modules are for.
const ENVIRONMENT: TargetEnv = TargetEnv::Vulkan_1_2;

/// Hash of this crate's code that final SPIR-V follows from (`build.rs` collects it): committed
/// SPIR-V of another hash counts as stale.
pub const PIPELINE: &str = env!("HANKEL_PIPELINE_SHA256");

/// Rounds of optimisation at most; iterators within each other take seven.
const MOST_ROUNDS: u32 = 16;

/// A finished module.
#[derive(Clone, Debug, PartialEq)]
pub struct Finished {
    /// The binary, little end first.
    pub spirv: Vec<u8>,
    /// What it costs.
    pub cost: Cost,
}

/// Finishes the module of `kernel`: one entry point, as rust-gpu writes it.
///
/// # Errors
///
/// The binary is damaged or invalid, a tool fails, or the module is not what `kernel` describes.
pub fn finish(raw: &[u8], kernel: &Kernel) -> Result<Finished, Failure> {
    let name = kernel.name.as_str();
    let words = spirv::words(raw, name)?;
    // Of what cannot be read, spirv-val says more.
    let mut module =
        spirv::load(&words, name).or_else(|unread| validate(&words, name).and(Err(unread)))?;
    let place = Some(format!("{}:{}", kernel.file, kernel.line));
    // rust-gpu leaves no lines of the source in a module.
    let placed = |failure: Failure| Failure {
        construct: failure.construct.or_else(|| place.clone()),
        ..failure
    };
    widths::mend(&mut module);
    offsets::make_constant(&mut module);
    narrow::widen(&mut module, name).map_err(placed)?;
    if holders::are_passed(&module) {
        let words = run_passes(&module, name, |passes| {
            passes
                .register_pass(Passes::InlineExhaustive)
                .register_pass(Passes::EliminateDeadFunctions);
        })?;
        module = spirv::load(&words, name)?;
    }
    // What is left may be resolved by spirv-opt, unless it is invalid.
    let (mut has_references, mut left) = references::resolve(&mut module, name);
    while (holders::has_handles(&module) && parts::divide(&mut module))
        | holders::divide(&mut module)
        | references::forward_stores(&mut module)
        | holders::fold(&mut module)
    {
        let (has_more, still) = references::resolve(&mut module, name);
        has_references |= has_more;
        left = still;
    }
    check_raw(&module, name).map_err(|invalid| left.map_or(invalid, placed))?;
    refused::check(&module, name).map_err(placed)?;
    canonical::order(&mut module);
    libm::mend(&mut module);
    let (words, has_more) = optimise(module, name)?;
    let mut module = spirv::load(&words, name)?;
    refused::check_references(&module, name).map_err(placed)?;
    order::mend(&mut module);
    if has_references || has_more {
        references::near(&mut module);
    }
    let divided = if uniform::divides_at_barrier(&module, Memory::Trusted) {
        Some(("workgroup", "barrier"))
    } else if uniform::divides_at_subgroup(&module, Memory::Trusted, Group::Subgroup) {
        Some(("subgroup", "operation of it"))
    } else {
        None
    };
    if let Some((group, what)) = divided {
        return Err(Failure {
            kernel: name.into(),
            step: Step::Meaning,
            construct: place,
            message: format!(
                "not every invocation of a {group} reaches each {what}. One in a branch, or a loop, \
                 that some do not take; or a division, an index or an `unwrap` before it, which ends \
                 an invocation where it fails: write `x.checked_div(y)`, an index that is masked \
                 (`t[(i & 7) as usize]`), `unwrap_or`"
            ),
            panicked: false,
        });
    }
    if kernel.rounding != Rounding::Free {
        exact::keep(&mut module);
    }
    undefined::fill(&mut module);
    constants::retype(&mut module, kernel);
    empty::fill(&mut module);
    interface::apply(&mut module, kernel);
    trim::debug(&mut module);
    trim::capabilities(&mut module);
    trim::memory_model(&mut module);
    trim::accesses_of_textures(&mut module);
    reading::coordinate_types(&mut module);
    reading::late_operands(&mut module);
    split::apply(&mut module, kernel);
    names::apply(&mut module, kernel)?;
    let words = spirv::store(&module);
    validate(&words, name)?;
    Ok(Finished {
        spirv: spirv::bytes(&words),
        cost: cost::of_module(&module),
    })
}

/// Finishes a module again with specialisation constants replaced by values, by their names.
/// Branches that only other values take are gone afterwards. Names that the kernel does not have
/// are ignored.
///
/// # Errors
///
/// As for [`finish`].
pub fn freeze(
    spirv: &[u8],
    kernel: &Kernel,
    values: &BTreeMap<String, ConstantValue>,
) -> Result<Finished, Failure> {
    let name = kernel.name.as_str();
    let mut module = spirv::load(&spirv::words(spirv, name)?, name)?;
    for param in &kernel.params {
        if let (Role::Constant { id, scalar, .. }, Some(value)) =
            (&param.role, values.get(&param.name))
            && let Some(word) = value.word(*scalar)
        {
            spirv::freeze_constant(&mut module, *id, word);
        }
    }
    finish(&spirv::bytes(&spirv::store(&module)), kernel)
}

/// The cost of anybody's module after the same optimisation, to compare a listing with a kernel.
///
/// # Errors
///
/// The binary is damaged or invalid; `name` is what the error calls it.
pub fn cost_after_optimisation(raw: &[u8], name: &str) -> Result<Cost, Failure> {
    let words = spirv::words(raw, name)?;
    validate(&words, name)?;
    let (words, _) = optimise(spirv::load(&words, name)?, name)?;
    Ok(cost::of_module(&spirv::load(&words, name)?))
}

/// Runs spirv-opt with floating-point arithmetic held as it is written. Tells whether references were resolved that
/// had been in structures.
pub(crate) fn optimise(mut module: Module, name: &str) -> Result<(Vec<u32>, bool), Failure> {
    let mut has_references = false;
    exact::pin(&mut module);
    exact::fold(&mut module);
    halves::fold(&mut module);
    tables::reach_constants(&mut module);
    // Inlining and unrolling bring constants together, and what they decide may bring more.
    for _ in 0..MOST_ROUNDS {
        let words = run_passes(&module, name, |passes| {
            passes
                .register_pass(Passes::StripDebugInfo)
                .register_performance_passes()
                .register_pass(Passes::LoopInvariantCodeMotion)
                .register_pass(Passes::IfConversion)
                .register_pass(Passes::LocalRedundancyElimination)
                .register_pass(Passes::RedundancyElimination)
                .register_pass(Passes::CombineAccessChains)
                .register_pass(Passes::Simplification)
                .register_pass(Passes::VectorDCE)
                .register_pass(Passes::AggressiveDCE)
                .register_pass(Passes::DeadBranchElim)
                .register_pass(Passes::BlockMerge)
                .register_pass(Passes::CFGCleanup)
                .register_pass(Passes::AggressiveDCE);
        })?;
        module = spirv::load(&words, name)?;
        let is_divided = parts::divide(&mut module);
        has_references |= is_divided && references::resolve(&mut module, name).0;
        let changes = [
            exact::fold(&mut module),
            halves::fold(&mut module),
            bounds::fold(&mut module),
            branches::fold(&mut module),
            branches::thread(&mut module),
            tables::keep(&mut module),
            references::sweep(&mut module),
        ];
        if !is_divided && changes == [false; 7] {
            break;
        }
    }
    let words = run_passes(&module, name, |passes| {
        passes
            .register_pass(Passes::LocalRedundancyElimination)
            .register_pass(Passes::AggressiveDCE)
            .register_pass(Passes::UnifyConstant)
            .register_pass(Passes::RemoveDuplicates)
            .register_pass(Passes::EliminateDeadConstant)
            .register_pass(Passes::RemoveUnusedInterfaceVariables)
            .register_pass(Passes::CompactIds);
    })?;
    let mut module = spirv::load(&words, name)?;
    exact::unpin(&mut module);
    Ok((spirv::store(&module), has_references))
}

fn run_passes(
    module: &Module,
    name: &str,
    register: impl FnOnce(&mut spirv_tools::opt::compiled::CompiledOptimizer),
) -> Result<Vec<u32>, Failure> {
    let mut optimizer =
        spirv_tools::opt::compiled::CompiledOptimizer::with_env(environment_of(module));
    register(&mut optimizer);
    let mut said = Vec::new();
    let result = optimizer.optimize(
        spirv::store(module),
        &mut |message: spirv_tools::error::Message| said.push(message.message),
        Some(spirv_tools::opt::Options {
            preserve_spec_constants: true,
            ..Default::default()
        }),
    );
    match result {
        Ok(binary) => Ok(binary.as_words().to_vec()),
        Err(error) => Err(Failure {
            kernel: name.into(),
            step: Step::Optimise,
            construct: None,
            message: if said.is_empty() {
                error.to_string()
            } else {
                said.join("; ")
            },
            panicked: false,
        }),
    }
}

/// spirv-val for what rust-gpu made. Structures may still hold textures and samplers, which is Vulkan's rule alone: a
/// function that takes one has it in a structure, until it is inlined.
fn check_raw(module: &Module, name: &str) -> Result<(), Failure> {
    validate_in(environment_of(module), &spirv::store(module), name)
}

/// By whose rules a module is read that is not finished.
fn environment_of(module: &Module) -> TargetEnv {
    match holders::has_handles(module) {
        true => TargetEnv::Universal_1_5,
        false => ENVIRONMENT,
    }
}

/// spirv-val for Vulkan 1.2.
///
/// # Errors
///
/// The module is invalid.
pub fn validate(words: &[u32], name: &str) -> Result<(), Failure> {
    validate_in(ENVIRONMENT, words, name)
}

fn validate_in(environment: TargetEnv, words: &[u32], name: &str) -> Result<(), Failure> {
    let validator = spirv_tools::val::create(Some(environment));
    guarded(
        || {
            validator.validate(words, None).map_err(|error| {
                let (message, construct) = match error.diagnostic {
                    Some(told) => {
                        // Where spirv-val quotes the instruction, it does so on a line of its own.
                        let mut lines = told.message.trim().splitn(2, '\n');
                        let message = lines.next().unwrap_or_default().trim().to_owned();
                        let quoted = [lines.next().unwrap_or_default(), told.notes.as_str()]
                            .into_iter()
                            .map(str::trim)
                            .find(|text| !text.is_empty())
                            .map(|text| format!("`{text}`"));
                        (message, quoted)
                    }
                    None => (error.inner.to_string(), None),
                };
                Failure {
                    kernel: name.into(),
                    step: Step::Validate,
                    construct,
                    message,
                    panicked: false,
                }
            })
        },
        name,
        Step::Validate,
    )
}
