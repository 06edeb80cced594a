//! Workgroups on the host: each invocation is a future that yields at every barrier, and at every
//! operation of its subgroup. One thread runs a workgroup, its subgroups in turn from barrier to
//! barrier, and of each the invocations in turn from operation to operation.

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
use super::sanitize::{self, Space};
use super::subgroup;
use crate::Stored;

/// Workgroup memory, filled with what nobody expects: it is to be written before it is read.
pub fn memory<T: Stored, const N: usize>(name: &'static str) -> Box<[Cell<T>; N]> {
    let mut value = T::zeroed();
    bytemuck::bytes_of_mut(&mut value).fill(0xa5);
    let slots: Box<[Cell<T>]> = (0..N).map(|_| Cell::new(value)).collect();
    sanitize::name(name, &slots, size_of::<T>());
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
    /// Invocations of its subgroup.
    pub subgroup_size: u32,
    /// How many subgroups the workgroup has.
    pub subgroup_count: u32,
}

impl Invocation {
    /// The invocation at `at` of those in `extent`.
    #[inline]
    #[must_use]
    pub fn new(at: UVec3, extent: [u32; 3], threads: [u32; 3]) -> Self {
        let [extent, threads] = [extent, threads].map(UVec3::from_array);
        Self::of(at / threads, at % threads, extent, threads, 1)
    }

    /// Its subgroup: as many invocations in a row, as [`Self::local_index`] counts them.
    #[inline]
    #[must_use]
    pub const fn subgroup_id(&self) -> u32 {
        self.local_index / self.subgroup_size
    }

    /// Its number in its subgroup.
    #[inline]
    #[must_use]
    pub const fn subgroup_invocation_id(&self) -> u32 {
        self.local_index % self.subgroup_size
    }

    #[inline]
    fn of(group: UVec3, local: UVec3, extent: UVec3, threads: UVec3, subgroup_size: u32) -> Self {
        let at = group * threads + local;
        let inside = at.cmplt(extent).all();
        Self {
            at,
            local,
            local_index: (local.z * threads.y + local.y) * threads.x + local.x,
            group,
            groups: groups(extent, threads),
            number: inside.then(|| (at.z * extent.y + at.y) * extent.x + at.x),
            subgroup_size,
            subgroup_count: threads.element_product().div_ceil(subgroup_size),
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
    /// Whether anybody asks for subgroups.
    subgroups: bool,
    /// Invocations of a subgroup: all, if nobody asks.
    subgroup_size: u32,
}

/// An invocation, by its number in the workgroup, and where it waits; none if it has ended.
type Met = (usize, Option<Wait>);

/// Calls `f` for each workgroup that `extent` needs; `subgroups`: its invocations are in subgroups.
pub fn for_each_group(
    mode: Mode,
    extent: [u32; 3],
    threads: [u32; 3],
    subgroups: bool,
    f: impl Fn(Workgroup) + Sync,
) -> Result<(), CallError> {
    // Compiled once, not in each of the loops.
    let f: &(dyn Fn(Workgroup) + Sync) = &f;
    let [extent, threads] = [extent, threads].map(UVec3::from_array);
    let subgroup_size = if subgroups {
        subgroup::size(mode)?
    } else {
        threads.element_product()
    };
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
            subgroups,
            subgroup_size,
        });
    };
    guard(&mut || {
        if let Some(order) = sanitize::order(all) {
            for number in order {
                sanitize::begin_group(number);
                one(number as usize);
            }
        } else if mode.parallel {
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
        let count = (width * height * depth) as usize;
        let mut futures = Vec::with_capacity(count);
        let size = self.subgroup_size as usize;
        let subgroups = sanitize::order(count.div_ceil(size));
        let order = sanitize::order(size);
        let mut places = Vec::new();
        for z in 0..depth {
            for y in 0..height {
                for x in 0..width {
                    let local = UVec3::new(x, y, z);
                    let (extent, threads) = (self.extent, self.threads);
                    let it = Invocation::of(self.id, local, extent, threads, self.subgroup_size);
                    if order.is_some() {
                        places.push(it.at);
                    }
                    futures.push(make(it));
                }
            }
        }
        loop {
            let mut first = None;
            for turn in 0..count.div_ceil(size) {
                let subgroup = subgroups.as_ref().map_or(turn, |all| all[turn] as usize);
                let start = subgroup * size;
                let mine = start..count.min(start + size);
                let places = places.get(mine.clone()).unwrap_or_default();
                let order = order.as_deref();
                // SAFETY: the futures stay where they are until all of them are dropped: the vector
                // is neither grown nor moved from here on.
                let waits = unsafe { self.advance(&mut futures[mine], start, places, order) };
                match first {
                    None => first = Some(waits),
                    Some(first) if same(first.1, waits.1) => {}
                    Some(first) => self.diverged(first, waits),
                }
            }
            match first.and_then(|(_, waits)| waits).map(|wait| wait.at) {
                Some(Meeting::Barrier(orders)) => sanitize::passed(orders),
                _ => return,
            }
        }
    }

    /// Runs a subgroup, whose first invocation is `start`, to the next barrier or its end. Gives the
    /// invocation that was first, and where it waits.
    ///
    /// # Safety
    /// The futures are not moved any more.
    unsafe fn advance<F: Future<Output = ()>>(
        &self,
        futures: &mut [F],
        start: usize,
        places: &[UVec3],
        order: Option<&[u32]>,
    ) -> Met {
        let mut context = Context::from_waker(Waker::noop());
        let count = futures.len();
        loop {
            let mut first: Option<Met> = None;
            for turn in 0..order.map_or(count, <[u32]>::len) {
                let lane = order.map_or(turn, |order| order[turn] as usize);
                // The last subgroup of a workgroup may have fewer.
                let Some(future) = futures.get_mut(lane) else {
                    continue;
                };
                if let Some(at) = places.get(lane) {
                    sanitize::enter(*at);
                }
                if self.subgroups {
                    subgroup::enter(lane, count);
                }
                WAITS.set(None);
                // SAFETY: the caller's.
                let future = unsafe { Pin::new_unchecked(future) };
                let waits = match future.poll(&mut context) {
                    Poll::Ready(()) => None,
                    Poll::Pending => WAITS.get(),
                };
                let met = (start + lane, waits);
                match first {
                    None => first = Some(met),
                    Some(first) if same(first.1, waits) => {}
                    Some(first) => self.diverged(first, met),
                }
            }
            match first {
                Some((_, Some(wait))) if wait.at == Meeting::Subgroup => subgroup::exchange(),
                Some(met) => return met,
                None => return (start, None),
            }
        }
    }

    #[cold]
    fn diverged(&self, first: Met, other: Met) -> ! {
        let (x, y) = (self.threads.x, self.threads.y);
        let local = |i: usize| {
            let i = i as u32;
            triple(UVec3::new(i % x, i / x % y, i / (x * y)))
        };
        let of_subgroup = |met: Met| met.1.is_some_and(|wait| wait.at == Meeting::Subgroup);
        let what = if of_subgroup(first) || of_subgroup(other) {
            "an operation of the subgroup in control flow that is not the same for the subgroup"
        } else {
            "a barrier in control flow that is not uniform"
        };
        sanitize::refuse(format!(
            "{what}: in workgroup {}, invocation {} {}, but invocation {} {}",
            triple(self.id),
            local(first.0),
            state(first.1),
            local(other.0),
            state(other.1)
        ))
    }
}

fn triple(at: UVec3) -> String {
    format!("({}, {}, {})", at.x, at.y, at.z)
}

fn state(wait: Option<Wait>) -> String {
    match wait {
        Some(wait) => format!("waits at {}", wait.place),
        None => "has ended".into(),
    }
}

/// Where an invocation waits.
#[derive(Clone, Copy, Debug)]
pub(super) struct Wait {
    pub(super) place: &'static Location<'static>,
    pub(super) at: Meeting,
}

/// At what it waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Meeting {
    /// A barrier, which orders accesses to memory.
    Barrier(Space),
    /// An operation of the subgroup.
    Subgroup,
}

/// The invocation that runs is about to yield.
#[inline]
pub(super) fn waits(wait: Wait) {
    WAITS.set(Some(wait));
}

fn same(a: Option<Wait>, b: Option<Wait>) -> bool {
    match (a, b) {
        (Some(a), Some(b)) => core::ptr::eq(a.place, b.place) || a.place == b.place,
        (None, None) => true,
        _ => false,
    }
}

thread_local! {
    /// The barrier at which the invocation that just yielded waits; none if it has ended.
    static WAITS: Cell<Option<Wait>> = const { Cell::new(None) };
}

/// A barrier in the twin of a kernel.
#[derive(Debug)]
pub struct Barrier {
    wait: Wait,
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
        waits(self.wait);
        Poll::Pending
    }
}

/// What stands for [`barrier`](crate::barrier) in the twin.
#[inline]
#[track_caller]
#[must_use]
pub fn barrier() -> Barrier {
    waiting(Space::Workgroup, Location::caller())
}

/// What stands for [`storage_barrier`](crate::storage_barrier) in the twin.
#[inline]
#[track_caller]
#[must_use]
pub fn storage_barrier() -> Barrier {
    waiting(Space::Storage, Location::caller())
}

const fn waiting(orders: Space, place: &'static Location<'static>) -> Barrier {
    Barrier {
        wait: Wait {
            place,
            at: Meeting::Barrier(orders),
        },
        passed: false,
    }
}
