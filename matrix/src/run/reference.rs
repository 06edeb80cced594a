//! The native runs that everything is compared with.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::slice;
use std::sync::OnceLock;

use hankel_codegen::files::sha256;
use hankel_dsl::native::describe::{Kernel, Subgroups};
use hankel_dsl::native::{Mode, SUBGROUP_SIZES};
use hankel_host::device::{DeviceError, NativeDevice};
use hankel_host::flush::flushed as flushed_run;
use hankel_host::inputs::{self, Case};
use hankel_host::parity::execute::{self, Written};
use hankel_host::parity::intervals::{Intervals, Products};
use hankel_host::parity::{panics, sanitize};
use rayon::prelude::*;

use super::Request;
use crate::column::Column;
use crate::prepare::Prepared;
use crate::subject::Subject;

/// A kernel with its inputs and the reference's results.
pub(super) struct Ready<'a> {
    pub(super) subject: &'a Subject,
    pub(super) prepared: Prepared,
    pub(super) inputs: PathBuf,
    /// SHA-256 of inputs and reference.
    pub(super) hash: String,
    pub(super) reference: Result<Vec<Written>, String>,
    /// The same as on a device that flushes subnormal numbers; none where that cannot be had.
    pub(super) flushed: Option<Result<Vec<Written>, String>>,
    /// The references for each size that subgroups may have on a device, for a kernel whose result
    /// depends on it: what does not flush, and what does.
    by_size: [Vec<Result<Vec<Written>, String>>; 2],
    pub(super) simd: Result<Vec<Written>, String>,
    /// For each case what samplers may do to its numbers; none for kernels without samplers.
    intervals: Vec<Option<Intervals>>,
    /// The same of devices that round products of weights, found when the first column has one.
    intervals_of_rounded: OnceLock<Result<Vec<Option<Intervals>>, String>>,
}

impl Ready<'_> {
    pub(super) fn kernel(&self) -> &Kernel {
        &self.subject.entry.kernel
    }

    /// For each case what samplers of a device may do to its numbers; none for kernels without samplers.
    pub(super) fn intervals(&self, products: Products) -> Result<&[Option<Intervals>], &String> {
        match products {
            Products::Exact => Ok(&self.intervals),
            Products::Rounded => self
                .intervals_of_rounded
                .get_or_init(|| {
                    let reference = self.reference.clone()?;
                    intervals(self.subject, &self.prepared, &reference, products)
                })
                .as_deref(),
        }
    }

    /// What a column, whose device `flushes` subnormal numbers or not, is compared with: it agrees if it agrees with
    /// one of them.
    pub(super) fn references_for(
        &self,
        column: Column,
        flushes: bool,
    ) -> &[Result<Vec<Written>, String>] {
        let flushes = flushes && self.flushed.is_some();
        let by_size = &self.by_size[usize::from(flushes)];
        match &self.flushed {
            // Natively the size is known.
            _ if !by_size.is_empty() && column.language().is_some() => by_size,
            Some(flushed) if flushes => slice::from_ref(flushed),
            _ => slice::from_ref(&self.reference),
        }
    }
}

/// Makes the inputs of all kernels, and runs them natively.
pub(super) fn references<'a>(
    request: &Request,
    subjects: &'a [Subject],
    work: &Path,
) -> io::Result<Vec<Ready<'a>>> {
    subjects
        .par_iter()
        .map(|subject| reference(request, subject, work))
        .collect()
}

fn reference<'a>(request: &Request, subject: &'a Subject, work: &Path) -> io::Result<Ready<'a>> {
    let kernel = &subject.entry.kernel;
    let inputs = work.join(format!("{}.inputs", subject.name));
    let (cases, problem) = match inputs::of_entry(&subject.entry, request.seed) {
        Ok(cases) => (cases, None),
        Err(e) => (Vec::new(), Some(format!("there are no inputs: {e}"))),
    };
    let prepared = Prepared::new(kernel, cases, &inputs)?;
    let program = subject.entry.program(None, &[]);
    let run = |mode: Mode, case: &Case| {
        execute::dispatch(&mut NativeDevice::with_mode(mode), &program, case)
    };
    let natively = |mode: Mode| -> Result<Vec<Written>, String> {
        if let Some(problem) = &problem {
            return Err(problem.clone());
        }
        let explained = |case: &Case, error: DeviceError| {
            let at = panics::culprit(kernel, case, |shorter| run(mode, shorter).is_err());
            let at = at.map_or_else(String::new, |at| format!("; {at}"));
            format!("{}: {error}{at}", case.called())
        };
        prepared
            .cases
            .iter()
            .map(|case| run(mode, case).map_err(|e| explained(case, e)))
            .collect()
    };
    // Where invocations can meet, the reference is a sanitized run, in three orders.
    let reference = if sanitize::meets(kernel) && problem.is_none() {
        let checked = prepared.cases.iter().map(|case| {
            sanitize::check(kernel, case, run)
                .map_err(|fault| format!("{}: {fault}", case.called()))
        });
        checked.collect()
    } else {
        natively(Mode::REFERENCE)
    };
    let flushed = request
        .columns
        .iter()
        .any(|c| c.may_flush())
        .then(|| flushed_run(|| natively(Mode::REFERENCE)))
        .flatten();
    let sizes = SUBGROUP_SIZES.map(|size| Mode::REFERENCE.in_subgroups_of(size));
    let by_size = if kernel.subgroups == Subgroups::Sized {
        let plain = sizes.map(natively).into();
        let flush = flushed.is_some().then(|| {
            let runs = sizes.map(|mode| flushed_run(|| natively(mode)));
            runs.into_iter().flatten().collect()
        });
        [plain, flush.unwrap_or_default()]
    } else {
        [Vec::new(), Vec::new()]
    };
    let simd = natively(Mode::default());
    let found = reference.and_then(|reference| {
        let intervals = intervals(subject, &prepared, &reference, Products::Exact)?;
        Ok((reference, intervals))
    });
    let (reference, intervals) = match found {
        Ok((reference, intervals)) => (Ok(reference), intervals),
        Err(problem) => (Err(problem), Vec::new()),
    };
    let mut all = fs::read(&inputs)?;
    let references = reference
        .iter()
        .chain(flushed.iter().flatten())
        .chain(by_size.iter().flatten().flatten());
    for written in references.flatten().flatten() {
        all.extend_from_slice(written);
    }
    for ends in intervals.iter().flatten() {
        all.extend(ends.bytes());
    }
    Ok(Ready {
        subject,
        prepared,
        inputs,
        hash: sha256(&all),
        reference,
        flushed,
        by_size,
        simd,
        intervals,
        intervals_of_rounded: OnceLock::new(),
    })
}

/// For each case what samplers may do to its numbers.
fn intervals(
    subject: &Subject,
    prepared: &Prepared,
    reference: &[Written],
    products: Products,
) -> Result<Vec<Option<Intervals>>, String> {
    let program = subject.entry.program(None, &[]);
    let run = |case: &Case| {
        execute::dispatch(
            &mut NativeDevice::with_mode(Mode::REFERENCE),
            &program,
            case,
        )
    };
    let cases = prepared.cases.iter().zip(reference);
    cases
        .map(|(case, written)| {
            Intervals::find(&subject.entry.kernel, case, written, products, run)
                .map_err(|e| e.to_string())
        })
        .collect()
}
