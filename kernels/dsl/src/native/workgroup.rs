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
use super::sanitize::{self, Space};
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
        let order = sanitize::order(count);
        let mut places = Vec::new();
        for z in 0..depth {
            for y in 0..height {
                for x in 0..width {
                    let local = UVec3::new(x, y, z);
                    let it = Invocation::of(self.id, local, self.extent, self.threads);
                    if order.is_some() {
                        places.push(it.at);
                    }
                    futures.push(make(it));
                }
            }
        }
        let mut context = Context::from_waker(Waker::noop());
        loop {
            let mut first = (0, None);
            for turn in 0..count {
                let i = order.as_ref().map_or(turn, |order| order[turn] as usize);
                if let Some(at) = places.get(i) {
                    sanitize::enter(*at);
                }
                WAITS.set(None);
                // SAFETY: the futures stay where they are until all of them are dropped: the vector
                // is neither grown nor moved from here on.
                let future = unsafe { Pin::new_unchecked(&mut futures[i]) };
                let waits = match future.poll(&mut context) {
                    Poll::Ready(()) => None,
                    Poll::Pending => WAITS.get(),
                };
                if turn == 0 {
                    first = (i, waits);
                } else if !same(first.1, waits) {
                    self.diverged(first, (i, waits));
                }
            }
            match first.1 {
                None => return,
                Some(wait) => sanitize::passed(wait.orders),
            }
        }
    }

    #[cold]
    fn diverged(&self, first: (usize, Option<Wait>), other: (usize, Option<Wait>)) -> ! {
        let (x, y) = (self.threads.x, self.threads.y);
        let local = |i: usize| {
            let i = i as u32;
            triple(UVec3::new(i % x, i / x % y, i / (x * y)))
        };
        sanitize::refuse(format!(
            "a barrier in control flow that is not uniform: in workgroup {}, invocation {} {}, but invocation {} {}",
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
struct Wait {
    place: &'static Location<'static>,
    orders: Space,
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
        WAITS.set(Some(self.wait));
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
        wait: Wait { place, orders },
        passed: false,
    }
}
