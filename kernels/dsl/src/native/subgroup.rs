//! Subgroups on the host. The invocations of a subgroup come to an operation one after the other, each
//! leaves its value and yields; when all are there, each takes what the operation gives it.

use core::cell::RefCell;
use core::future::Future;
use core::marker::PhantomData;
use core::panic::Location;
use core::pin::Pin;
use core::task::{Context, Poll};
use std::{format, thread_local};

use glam::UVec4;

use super::call::{CallError, Mode, SUBGROUP_SIZES};
use super::sanitize::refuse;
use super::workgroup::{Meeting, Wait, waits};
use crate::{SubgroupInteger, SubgroupNumber, SubgroupValue};

/// The largest subgroup.
const MOST: usize = SUBGROUP_SIZES[SUBGROUP_SIZES.len() - 1] as usize;

/// What is read of an invocation that is not there: what nobody expects.
const NOBODY: u32 = 0xa5a5_a5a5;

/// What an invocation brings to an operation.
#[derive(Clone, Copy)]
struct Brought {
    words: [u32; 4],
    /// What must be the same for the subgroup.
    same: u32,
}

/// The subgroup that this thread runs.
struct Subgroup {
    /// Invocations that there are: fewer than its size where the workgroup ends.
    count: usize,
    /// The invocation that runs.
    lane: usize,
    /// What they bring to the next operation.
    next: [Brought; MOST],
    /// What they brought to the last one.
    last: [Brought; MOST],
}

const NOTHING: Brought = Brought {
    words: [0; 4],
    same: 0,
};

thread_local! {
    static SUBGROUP: RefCell<Subgroup> = const {
        RefCell::new(Subgroup { count: 0, lane: 0, next: [NOTHING; MOST], last: [NOTHING; MOST] })
    };
}

/// The size of subgroups, if there is one like that.
///
/// # Errors
/// There is none.
pub fn size(mode: Mode) -> Result<u32, CallError> {
    let size = mode.subgroup_size;
    if SUBGROUP_SIZES.contains(&size) {
        Ok(size)
    } else {
        Err(CallError::Subgroups { size })
    }
}

/// Invocation `lane` of a subgroup of `count` goes on.
#[inline]
pub(super) fn enter(lane: usize, count: usize) {
    SUBGROUP.with_borrow_mut(|it| (it.lane, it.count) = (lane, count));
}

/// All invocations have come to the operation.
pub(super) fn exchange() {
    SUBGROUP.with_borrow_mut(|it| it.last = it.next);
}

impl Subgroup {
    fn value<T: SubgroupValue>(&self, lane: usize) -> T {
        let words = if lane < self.count {
            self.last[lane].words
        } else {
            [NOBODY; 4]
        };
        bytemuck::pod_read_unaligned(&bytemuck::bytes_of(&words)[..size_of::<T>()])
    }

    fn holds(&self) -> impl Iterator<Item = bool> {
        self.last[..self.count].iter().map(|it| it.words[0] != 0)
    }

    /// The values of the invocations below `end`, as one.
    fn folded<T: SubgroupValue>(&self, end: usize, first: T, both: fn(T, T) -> T) -> T {
        (0..end).fold(first, |all, lane| both(all, self.value(lane)))
    }

    /// The same without a value to begin with.
    fn reduced<T: SubgroupValue>(&self, both: fn(T, T) -> T) -> T {
        let all = (1..self.count).map(|lane| self.value(lane));
        all.fold(self.value(0), both)
    }

    /// What must be the same for the subgroup.
    fn same(&self, what: &str, place: &'static Location<'static>) -> usize {
        let first = self.last[0].same;
        if let Some(other) = self.last[..self.count].iter().find(|it| it.same != first) {
            refuse(format!(
                "the {what} at {place} must be the same for the subgroup: it is {first} in one invocation, {} in another",
                other.same
            ));
        }
        first as usize
    }
}

/// An operation of the subgroup in the twin of a kernel.
pub struct Operation<T, F> {
    mine: Option<Brought>,
    place: &'static Location<'static>,
    result: F,
    gives: PhantomData<fn() -> T>,
}

impl<T, F: Fn(&Subgroup) -> T + Unpin> Future for Operation<T, F> {
    type Output = T;

    #[inline]
    fn poll(mut self: Pin<&mut Self>, _: &mut Context<'_>) -> Poll<T> {
        SUBGROUP.with_borrow_mut(|subgroup| match self.mine.take() {
            Some(mine) => {
                let lane = subgroup.lane;
                subgroup.next[lane] = mine;
                waits(Wait {
                    place: self.place,
                    at: Meeting::Subgroup,
                });
                Poll::Pending
            }
            None => Poll::Ready((self.result)(subgroup)),
        })
    }
}

/// What an invocation can leave.
trait Words {
    /// As four words, zeros behind.
    fn words(self) -> [u32; 4];
}

impl Words for bool {
    #[inline]
    fn words(self) -> [u32; 4] {
        [self.into(), 0, 0, 0]
    }
}

impl<T: SubgroupValue> Words for T {
    #[inline]
    fn words(self) -> [u32; 4] {
        let mut words = [0; 4];
        bytemuck::bytes_of_mut(&mut words)[..size_of::<T>()]
            .copy_from_slice(bytemuck::bytes_of(&self));
        words
    }
}

#[inline]
fn with<T, F: Fn(&Subgroup) -> T + Unpin>(
    value: impl Words,
    same: u32,
    place: &'static Location<'static>,
    result: F,
) -> Operation<T, F> {
    let mine = Brought {
        words: value.words(),
        same,
    };
    Operation {
        mine: Some(mine),
        place,
        result,
        gives: PhantomData,
    }
}

/// What stands for the functions of [`crate::subgroup`] in the twin.
macro_rules! functions {
    ($($name:ident $(<$t:ident: $bound:ident $(, $number:ident)?>)?
        ($value:ident: $ty:ty $(, $same:ident)?)
        -> $out:ty = |$subgroup:ident, $place:ident| $result:expr;)*) => { $(
        #[allow(missing_docs, reason = "as the function that it stands for")]
        #[inline]
        #[track_caller]
        pub fn $name$(<$t: $bound $(, const $number: u32)?>)?(
            $value: $ty $(, $same: u32)?
        ) -> impl Future<Output = $out> {
            let $place = Location::caller();
            let same = functions!(@same $($same)?);
            with($value, same, $place, move |$subgroup| $result)
        }
    )* };
    (@same) => { 0 };
    (@same $same:ident) => { $same };
}

functions! {
    subgroup_any(value: bool) -> bool = |it, _place| it.holds().any(|holds| holds);
    subgroup_all(value: bool) -> bool = |it, _place| it.holds().all(|holds| holds);
    subgroup_ballot(value: bool) -> UVec4 = |it, _place| {
        let mut bits = [0_u32; 4];
        for (lane, holds) in it.holds().enumerate() {
            bits[lane / 32] |= u32::from(holds) << (lane % 32);
        }
        UVec4::from_array(bits)
    };
    subgroup_broadcast<T: SubgroupValue, INVOCATION>(value: T) -> T = |it, place| {
        if INVOCATION as usize >= it.count {
            refuse(format!(
                "subgroup_broadcast, at {place}, takes the value of invocation {INVOCATION} of a subgroup of {}",
                it.count
            ));
        }
        it.value(INVOCATION as usize)
    };
    subgroup_broadcast_first<T: SubgroupValue>(value: T) -> T = |it, _place| it.value(0);
    subgroup_shuffle_xor<T: SubgroupValue>(value: T, mask) -> T = |it, place| {
        it.value(it.lane ^ it.same("mask of subgroup_shuffle_xor", place))
    };
    subgroup_shuffle_up<T: SubgroupValue>(value: T, delta) -> T = |it, place| {
        let delta = it.same("delta of subgroup_shuffle_up", place);
        it.value(it.lane.checked_sub(delta).unwrap_or(MOST))
    };
    subgroup_shuffle_down<T: SubgroupValue>(value: T, delta) -> T = |it, place| {
        it.value(it.lane + it.same("delta of subgroup_shuffle_down", place))
    };
    subgroup_add<T: SubgroupNumber>(value: T) -> T = |it, _place| it.reduced(T::sum);
    subgroup_mul<T: SubgroupNumber>(value: T) -> T = |it, _place| it.reduced(T::product);
    subgroup_min<T: SubgroupNumber>(value: T) -> T = |it, _place| it.reduced(T::least);
    subgroup_max<T: SubgroupNumber>(value: T) -> T = |it, _place| it.reduced(T::greatest);
    subgroup_and<T: SubgroupInteger>(value: T) -> T = |it, _place| it.reduced(T::bitand);
    subgroup_or<T: SubgroupInteger>(value: T) -> T = |it, _place| it.reduced(T::bitor);
    subgroup_xor<T: SubgroupInteger>(value: T) -> T = |it, _place| it.reduced(T::bitxor);
    subgroup_inclusive_add<T: SubgroupNumber>(value: T) -> T =
        |it, _place| it.folded(it.lane + 1, T::NOTHING, T::sum);
    subgroup_exclusive_add<T: SubgroupNumber>(value: T) -> T =
        |it, _place| it.folded(it.lane, T::NOTHING, T::sum);
    subgroup_inclusive_mul<T: SubgroupNumber>(value: T) -> T =
        |it, _place| it.folded(it.lane + 1, T::ONE, T::product);
    subgroup_exclusive_mul<T: SubgroupNumber>(value: T) -> T =
        |it, _place| it.folded(it.lane, T::ONE, T::product);
    quad_broadcast<T: SubgroupValue, INDEX>(value: T) -> T = |it, _place| {
        const { assert!(INDEX < 4, "a quad has the invocations 0, 1, 2 and 3") };
        it.value(it.lane & !3 | INDEX as usize)
    };
    quad_swap_x<T: SubgroupValue>(value: T) -> T = |it, _place| it.value(it.lane ^ 1);
    quad_swap_y<T: SubgroupValue>(value: T) -> T = |it, _place| it.value(it.lane ^ 2);
    quad_swap_diagonal<T: SubgroupValue>(value: T) -> T = |it, _place| it.value(it.lane ^ 3);
}

#[allow(missing_docs, reason = "as the function that it stands for")]
#[inline]
#[track_caller]
pub fn subgroup_shuffle<T: SubgroupValue>(value: T, invocation: u32) -> impl Future<Output = T> {
    with(value, 0, Location::caller(), move |it| {
        it.value(invocation as usize)
    })
}
