//! Fragments on the host. Invocation `i` is the pixel at column `i % COLUMNS` and row `i / COLUMNS`
//! of a target, with varyings of its own. Where a kernel takes a derivative, the other three
//! fragments of its quad of 2 x 2 pixels are run as well, with the same varyings: each is begun again
//! with what is known of the others, until none is left that waits. What a fragment has written to
//! memory would be written again, and the others must not write at all (SPIR-V, "Helper Invocation"), so
//! that memory is written behind the last derivative; another order is refused.

use core::cell::RefCell;
use core::panic::Location;
use std::boxed::Box;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::vec::Vec;
use std::{format, thread_local};

use glam::{UVec3, Vec3, Vec4};

use super::call::{CallError, Mode};
use super::exec::{Slices, guard, map_parts};
use super::sanitize::{self, refuse};

/// Columns of the target that invocations are laid out in.
pub const COLUMNS: u32 = 64;

/// Where a fragment is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fragment {
    /// The pixel's centre, and its depth (0).
    pub coord: Vec3,
    /// Whether the primitive faces the viewer.
    pub front_facing: bool,
    /// Which sample of the pixel.
    pub sample_index: u32,
    /// Which samples the primitive covers, a bit for each.
    pub sample_mask: u32,
    /// The number of the primitive, each of which covers one pixel.
    pub primitive_index: u32,
}

impl Fragment {
    fn at(x: u32, y: u32, primitive_index: u32) -> Self {
        Self {
            coord: Vec3::new(x as f32 + 0.5, y as f32 + 0.5, 0.0),
            front_facing: true,
            sample_index: 0,
            sample_mask: 1,
            primitive_index,
        }
    }
}

/// Along which axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// From left to right.
    X,
    /// From one row to the next.
    Y,
}

/// Which fragments of the quad a derivative is taken of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grain {
    /// The first row or column.
    Coarse,
    /// The fragment's own row or column.
    Fine,
}

/// A derivative of which all four values are known.
struct Taken {
    values: [Vec4; 4],
    place: &'static Location<'static>,
}

/// The quad that this thread runs.
#[derive(Default)]
struct Quad {
    /// The fragment that runs now: bit 0 its column, bit 1 its row; none outside of fragments.
    lane: Option<usize>,
    /// Derivatives that it has taken.
    next: usize,
    taken: Vec<Taken>,
    /// What it waits with.
    waits: Option<(Vec4, &'static Location<'static>)>,
}

thread_local! {
    static QUAD: RefCell<Quad> = RefCell::default();
}

/// Unwinds a fragment that was dropped.
struct Discarded;
/// Unwinds a fragment that must know its neighbours first.
struct Waiting;

/// What stands for [`discard`](crate::discard).
pub fn discard() -> ! {
    assert!(
        QUAD.with_borrow(|quad| quad.lane.is_some()),
        "only a fragment can be discarded"
    );
    resume_unwind(Box::new(Discarded))
}

/// The value in all fragments of the quad, and which of them this one is.
fn exchange(value: Vec4, place: &'static Location<'static>) -> ([Vec4; 4], usize) {
    let known = QUAD.with_borrow_mut(|quad| {
        let Some(lane) = quad.lane else {
            refuse(format!(
                "a derivative outside of a fragment kernel, at {place}"
            ));
        };
        match quad.taken.get(quad.next) {
            Some(taken) => {
                if taken.place != place {
                    refuse(format!(
                        "derivatives in control flow that is not the same for a quad: one fragment comes to {}, another to {place}",
                        taken.place
                    ));
                }
                quad.next += 1;
                Some((taken.values, lane))
            }
            None => {
                quad.waits = Some((value, place));
                None
            }
        }
    });
    known.unwrap_or_else(|| {
        if let Some(wrote) = sanitize::wrote() {
            refuse(format!(
                "a derivative, at {place}, behind a write to memory, at {wrote}: take derivatives, and sample textures, before memory is written"
            ));
        }
        resume_unwind(Box::new(Waiting))
    })
}

/// What stands for [`dpdx`](crate::dpdx) and the like.
#[must_use]
pub fn derivative(
    value: Vec4,
    axis: Axis,
    grain: Grain,
    place: &'static Location<'static>,
) -> Vec4 {
    let (values, lane) = exchange(value, place);
    let (step, across) = match axis {
        Axis::X => (1, 2),
        Axis::Y => (2, 1),
    };
    let first = match grain {
        Grain::Coarse => 0,
        Grain::Fine => lane & across,
    };
    values[first | step] - values[first]
}

/// How coordinates differ between the fragment and its neighbours, along x and along y: one place
/// for both.
#[must_use]
pub fn gradients(at: Vec3, place: &'static Location<'static>) -> (Vec3, Vec3) {
    let (values, lane) = exchange(at.extend(0.0), place);
    let along = |step: usize| (values[lane | step] - values[lane & !step]).truncate();
    (along(1), along(2))
}

/// What stands for [`fwidth`](crate::fwidth) and the like.
#[must_use]
pub fn width(value: Vec4, grain: Grain, place: &'static Location<'static>) -> Vec4 {
    derivative(value, Axis::X, grain, place).abs() + derivative(value, Axis::Y, grain, place).abs()
}

/// How a run of a fragment ended.
enum Ended<T> {
    Value(T),
    Discarded,
    Waits(Vec4, &'static Location<'static>),
}

/// Runs one fragment of the quad from its beginning.
fn begin<T>(lane: usize, call: &dyn Fn() -> T) -> Ended<T> {
    QUAD.with_borrow_mut(|quad| {
        quad.lane = Some(lane);
        quad.next = 0;
        quad.waits = None;
    });
    let result = catch_unwind(AssertUnwindSafe(call));
    let (waits, left) = QUAD.with_borrow_mut(|quad| {
        quad.lane = None;
        (quad.waits.take(), quad.next < quad.taken.len())
    });
    match result {
        // It did not take all derivatives that its neighbours have taken.
        Ok(_) if left => diverged(),
        Ok(value) => Ended::Value(value),
        Err(payload) if payload.is::<Discarded>() => Ended::Discarded,
        Err(payload) => match waits.filter(|_| payload.is::<Waiting>()) {
            Some((value, place)) => Ended::Waits(value, place),
            None => resume_unwind(payload),
        },
    }
}

#[cold]
fn diverged() -> ! {
    refuse(
        "a derivative in control flow that is not the same for a quad: one of its fragments takes it, another ends or is discarded before"
            .into(),
    )
}

/// Runs invocation `i`; none if it is dropped. The kernel's code is behind a pointer: it is compiled once,
/// not in each of the places from which it is called.
fn one<T>(i: u32, call: &dyn Fn(&Fragment) -> T) -> Option<T> {
    let (x, y) = (i % COLUMNS, i / COLUMNS);
    let own = (x & 1 | (y & 1) << 1) as usize;
    let at = |lane: usize| {
        let lane = lane as u32;
        Fragment::at(x & !1 | lane & 1, y & !1 | lane >> 1, i)
    };
    QUAD.with_borrow_mut(|quad| quad.taken.clear());
    let call = |fragment: &Fragment| {
        let pixel = fragment.coord.as_uvec3();
        sanitize::enter_alone(UVec3::new(pixel.x, pixel.y, 0), pixel.y * COLUMNS + pixel.x);
        call(fragment)
    };
    loop {
        let (value, place) = match begin(own, &|| call(&at(own))) {
            Ended::Value(value) => return Some(value),
            Ended::Discarded => return None,
            Ended::Waits(value, place) => (value, place),
        };
        let mut values = [value; 4];
        for lane in (0..4).filter(|lane| *lane != own) {
            match begin(lane, &|| call(&at(lane))) {
                Ended::Waits(value, other) if other == place => values[lane] = value,
                _ => diverged(),
            }
        }
        QUAD.with_borrow_mut(|quad| quad.taken.push(Taken { values, place }));
    }
}

/// Runs a fragment kernel over arrays of varyings, in the order of the session if there is one. What a
/// fragment that is dropped would return stays as it is.
pub fn map_fragments<S: Slices>(
    mode: Mode,
    mut out: S,
    f: impl Fn(usize, &Fragment) -> S::Values + Sync,
) -> Result<(), CallError> {
    let run = |i: usize, out: &mut S, slot: usize| {
        if let Some(values) = one(i as u32, &|fragment: &Fragment| f(i, fragment)) {
            out.set(slot, values);
        }
    };
    let Some(order) = sanitize::order(out.count()) else {
        return map_parts(mode, out, &|start, mut part| {
            for i in 0..part.count() {
                run(start + i, &mut part, i);
            }
        });
    };
    guard(&mut || {
        for i in order.iter().map(|i| *i as usize) {
            run(i, &mut out, i);
        }
    })
}

/// A depth as it is stored.
#[must_use]
pub fn depth(depth: crate::Depth) -> f32 {
    depth.0.clamp(0.0, 1.0)
}

/// Drops what a fragment returns unless its only sample is to be written.
pub fn mask(mask: crate::SampleMask) {
    if mask.0 & 1 == 0 {
        crate::discard();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
    use std::string::ToString;

    use crate::{dpdx, dpdx_coarse, dpdy, fwidth};

    fn run(count: usize, f: impl Fn(&Fragment) -> f32 + Sync) -> Result<Vec<f32>, CallError> {
        let mut out = std::vec![-1.0; count];
        map_fragments(Mode::REFERENCE, (&mut out[..],), |_, at| (f(at),))?;
        Ok(out)
    }

    #[test]
    fn derivatives_are_differences_within_the_quad() {
        let square = |at: &Fragment| at.coord.x * at.coord.x * at.coord.y;
        let fine = run(130, |at| dpdx(square(at))).unwrap();
        let coarse = run(130, |at| dpdx_coarse(square(at))).unwrap();
        // Columns 2 and 3 of rows 0 and 1.
        let difference = |row: f32| (3.5 * 3.5 - 2.5 * 2.5) * (row + 0.5);
        for column in [2, 3] {
            assert_eq!(fine[column], difference(0.0));
            assert_eq!(fine[64 + column], difference(1.0));
            assert_eq!(coarse[64 + column], difference(0.0));
        }
    }

    #[test]
    fn a_derivative_of_a_derivative_is_taken() {
        let out = run(64, |at| {
            let slope = dpdy(at.coord.y * at.coord.y * at.coord.x);
            dpdx(slope) + fwidth(at.coord.x)
        });
        // (1.5² - 0.5²) per column, and 1.
        assert_eq!(out.unwrap(), [3.0; 64]);
    }

    #[test]
    fn what_is_discarded_is_not_written() {
        let out = run(4, |at| {
            if at.coord.x > 2.0 {
                crate::discard();
            }
            at.coord.x
        });
        assert_eq!(out.unwrap(), [0.5, 1.5, -1.0, -1.0]);
    }

    #[test]
    fn diverged_derivatives_are_reported() {
        let message = |result: Result<Vec<f32>, CallError>| result.unwrap_err().to_string();
        let branch = run(4, |at| if at.coord.x < 1.0 { dpdx(1.0) } else { 0.0 });
        assert!(message(branch).contains("not the same for a quad"));
        let gone = run(4, |at| {
            if at.coord.x < 1.0 {
                crate::discard();
            }
            dpdx(at.coord.x)
        });
        assert!(message(gone).contains("not the same for a quad"));
        let two = run(4, |at| {
            if at.coord.x < 1.0 {
                dpdx(1.0)
            } else {
                dpdy(1.0)
            }
        });
        assert!(message(two).contains("not the same for a quad"));
    }

    #[test]
    fn memory_is_written_once_by_each_fragment_and_behind_derivatives() {
        let memory = [const { AtomicU32::new(0) }; 4];
        let counts = crate::Atomics::<u32>::new(&memory);
        let run = |mode: Mode, f: &(dyn Fn(&Fragment) -> f32 + Sync)| {
            let (mode, _session) = sanitize::begin(mode.looked_at());
            let mut out = std::vec![0.0; 4];
            map_fragments(mode, (&mut out[..],), |_, at| (f(at),)).map_err(|e| e.to_string())
        };
        let after = |at: &Fragment| {
            let slope = dpdx(at.coord.x);
            counts.add(at.coord.x as u32, 1);
            slope
        };
        for mode in [
            Mode::REFERENCE,
            Mode::sanitized(sanitize::Order::Descending),
        ] {
            run(mode, &after).unwrap();
        }
        assert_eq!(memory.each_ref().map(|n| n.load(Relaxed)), [2; 4]);
        let before = |at: &Fragment| {
            counts.add(at.coord.x as u32, 1);
            dpdx(at.coord.x)
        };
        let message = run(Mode::REFERENCE, &before).unwrap_err();
        assert!(
            message.contains("behind a write to memory, at "),
            "{message}"
        );
    }

    #[test]
    fn fragments_race() {
        let memory = [const { AtomicU32::new(0) }; 1];
        let all = crate::StorageMut::<u32>::new(&memory);
        let (mode, _session) = sanitize::begin(Mode::sanitized(sanitize::Order::Ascending));
        let mut out = std::vec![0.0; 2];
        let result = map_fragments(mode, (&mut out[..],), |i, _| {
            all.set(0, i as u32);
            (0.0,)
        });
        let message = result.unwrap_err().to_string();
        assert!(
            message.contains("data race: invocation (0, 0, 0) writes"),
            "{message}"
        );
        assert!(
            message.contains("and invocation (1, 0, 0) writes it"),
            "{message}"
        );
    }

    #[test]
    fn depths_are_clamped() {
        assert_eq!(depth(crate::Depth(2.0)), 1.0);
        assert_eq!(depth(crate::Depth(-1.0)), 0.0);
    }
}
