//! Workgroups on the host: each invocation is a future that yields at every barrier. One thread
//! runs a workgroup, its invocations in turn from barrier to barrier.

use core::cell::Cell;
use core::future::Future;
use core::panic::Location;
use core::pin::Pin;
use core::task::{Context, Poll, Waker};
use std::boxed::Box;
use std::format;
use std::string::String;
use std::thread_local;
use std::vec::Vec;

use glam::UVec3;
use rayon::prelude::*;

use super::call::{CallError, Mode};
use super::exec::guard;
use crate::Stored;

/// Workgroup memory, filled with what nobody expects: it is to be written before it is read.
pub fn memory<T: Stored, const N: usize>() -> Box<[Cell<T>; N]> {
    let mut value = T::zeroed();
    bytemuck::bytes_of_mut(&mut value).fill(0xa5);
    let slots: Box<[Cell<T>]> = (0..N).map(|_| Cell::new(value)).collect();
    match slots.try_into() {
        Ok(slots) => slots,
        Err(_) => unreachable!("it has N slots"),
    }
}

/// Where an invocation is.
#[derive(Clone, Copy, Debug)]
pub struct Invocation {
    /// Among all.
    pub at: UVec3,
    /// In its workgroup.
    pub local: UVec3,
    /// Its number in its workgroup, counted along x, then y, then z.
    pub local_index: u32,
    /// Its workgroup.
    pub group: UVec3,
    /// How many workgroups there are.
    pub groups: UVec3,
    /// Its number among all in range; none beyond.
    pub number: Option<u32>,
}

impl Invocation {
    /// The invocation at `at` of those in `extent`.
    #[inline]
    #[must_use]
    pub fn new(at: UVec3, extent: [u32; 3], threads: [u32; 3]) -> Self {
        let [extent, threads] = [extent, threads].map(UVec3::from_array);
        Self::of(at / threads, at % threads, extent, threads)
    }

    #[inline]
    fn of(group: UVec3, local: UVec3, extent: UVec3, threads: UVec3) -> Self {
        let at = group * threads + local;
        let inside = at.cmplt(extent).all();
        Self {
            at,
            local,
            local_index: (local.z * threads.y + local.y) * threads.x + local.x,
            group,
            groups: groups(extent, threads),
            number: inside.then(|| (at.z * extent.y + at.y) * extent.x + at.x),
        }
    }
}

fn groups(extent: UVec3, threads: UVec3) -> UVec3 {
    let count = |n: u32, t: u32| n.div_ceil(t);
    UVec3::new(
        count(extent.x, threads.x),
        count(extent.y, threads.y),
        count(extent.z, threads.z),
    )
}

/// A workgroup to be run.
#[derive(Clone, Copy, Debug)]
pub struct Workgroup {
    id: UVec3,
    extent: UVec3,
    threads: UVec3,
}

/// Calls `f` for each workgroup that `extent` needs.
pub fn for_each_group(
    mode: Mode,
    extent: [u32; 3],
    threads: [u32; 3],
    f: impl Fn(Workgroup) + Sync,
) -> Result<(), CallError> {
    let [extent, threads] = [extent, threads].map(UVec3::from_array);
    let count = groups(extent, threads);
    let all = count.x as usize * count.y as usize * count.z as usize;
    let one = |i: usize| {
        let (row, slice) = (count.x as usize, count.x as usize * count.y as usize);
        let id = UVec3::new(
            (i % row) as u32,
            (i % slice / row) as u32,
            (i / slice) as u32,
        );
        f(Workgroup {
            id,
            extent,
            threads,
        });
    };
    guard(|| {
        if mode.parallel {
            (0..all).into_par_iter().for_each(one);
        } else {
            (0..all).for_each(one);
        }
    })
}

impl Workgroup {
    /// Runs its invocations, each the future that `make` gives, from barrier to barrier.
    pub fn run<F: Future<Output = ()>>(&self, make: impl Fn(Invocation) -> F) {
        let [width, height, depth] = self.threads.to_array();
        let mut futures = Vec::with_capacity((width * height * depth) as usize);
        for z in 0..depth {
            for y in 0..height {
                for x in 0..width {
                    let local = UVec3::new(x, y, z);
                    let it = Invocation::of(self.id, local, self.extent, self.threads);
                    futures.push(make(it));
                }
            }
        }
        let mut context = Context::from_waker(Waker::noop());
        loop {
            let mut first = None;
            for (i, future) in futures.iter_mut().enumerate() {
                WAITS.set(None);
                // SAFETY: the futures stay where they are until all of them are dropped: the vector
                // is neither grown nor moved from here on.
                let future = unsafe { Pin::new_unchecked(future) };
                let waits = match future.poll(&mut context) {
                    Poll::Ready(()) => None,
                    Poll::Pending => WAITS.get(),
                };
                if i == 0 {
                    first = waits;
                } else if !same(first, waits) {
                    self.diverged(i as u32, first, waits);
                }
            }
            if first.is_none() {
                return;
            }
        }
    }

    #[cold]
    fn diverged(&self, i: u32, first: Place, other: Place) -> ! {
        let (x, y) = (self.threads.x, self.threads.y);
        let local = UVec3::new(i % x, i / x % y, i / (x * y));
        panic!(
            "a barrier in control flow that is not uniform: in workgroup {}, invocation (0, 0, 0) {}, but invocation {} {}",
            triple(self.id),
            state(first),
            triple(local),
            state(other)
        )
    }
}

fn triple(at: UVec3) -> String {
    format!("({}, {}, {})", at.x, at.y, at.z)
}

fn state(place: Place) -> String {
    match place {
        Some(place) => format!("waits at {place}"),
        None => "has ended".into(),
    }
}

/// Where an invocation waits; none if it has ended.
type Place = Option<&'static Location<'static>>;

fn same(a: Place, b: Place) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => core::ptr::eq(a, b) || a == b,
        (None, None) => true,
        _ => false,
    }
}

thread_local! {
    /// The barrier at which the invocation that just yielded waits.
    static WAITS: Cell<Place> = const { Cell::new(None) };
}

/// A barrier in the twin of a kernel.
#[derive(Debug)]
pub struct Barrier {
    place: &'static Location<'static>,
    passed: bool,
}

impl Future for Barrier {
    type Output = ();

    #[inline]
    fn poll(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<()> {
        if self.passed {
            return Poll::Ready(());
        }
        self.passed = true;
        WAITS.set(Some(self.place));
        Poll::Pending
    }
}

/// What stands for [`barrier`](crate::barrier) in the twin.
#[inline]
#[track_caller]
#[must_use]
pub fn barrier() -> Barrier {
    Barrier {
        place: Location::caller(),
        passed: false,
    }
}

/// What stands for [`storage_barrier`](crate::storage_barrier) in the twin.
#[inline]
#[track_caller]
#[must_use]
pub fn storage_barrier() -> Barrier {
    barrier()
}
