//! The sanitizer: a call is run invocation by invocation on one thread, in a chosen order, and every
//! access to memory that is written is looked at. The first fault ends the call with a panic that
//! says what happened, where in the kernel's source, and which invocations took part.
//!
//! What it finds: data races in buffers, textures and workgroup memory; workgroup memory that is
//! read before it is written; accesses out of range. The executor itself finds barriers, operations of
//! subgroups and derivatives in control flow that is not uniform.
//!
//! Two accesses to the same word race if different invocations make them, at least one writes, not
//! both are atomic, and nothing orders them. A [`barrier`](crate::barrier) orders accesses to
//! workgroup memory, a [`storage_barrier`](crate::storage_barrier) those to buffers, both within one
//! workgroup only. Nothing orders two workgroups of a dispatch, nor accesses to texels. (SPIR-V, "Memory Model";
//! WGSL, "Memory Model".)
//!
//! Outside of a sanitized call all of this costs one load and one branch for each access.

use core::cell::RefCell;
use core::fmt;
use core::ops::Range;
use core::panic::Location;
use core::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::backtrace::Backtrace;
use std::boxed::Box;
use std::collections::HashMap;
use std::string::{String, ToString};
use std::sync::Once;
use std::vec::Vec;
use std::{format, panic, thread_local};

use glam::UVec3;
use serde::{Deserialize, Serialize};

use super::call::{Mode, TextureRef, level_size};

/// In which order invocations run; those of a workgroup between two barriers, and workgroups.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Order {
    /// As they are numbered.
    Ascending,
    /// The other way round.
    Descending,
    /// Shuffled; the same for the same number.
    Shuffled(u32),
}

impl Order {
    /// Those that find out whether a result depends on the order.
    pub const ALL: [Self; 3] = [Self::Ascending, Self::Descending, Self::Shuffled(1)];

    /// As a number that is not 0, which crosses the border of a plug-in.
    pub(super) const fn code(self) -> u32 {
        match self {
            Self::Ascending => 1,
            Self::Descending => 2,
            Self::Shuffled(seed) => seed.saturating_add(3),
        }
    }

    /// Back; none for 0.
    pub(super) const fn of_code(code: u32) -> Option<Self> {
        match code {
            0 => None,
            1 => Some(Self::Ascending),
            2 => Some(Self::Descending),
            n => Some(Self::Shuffled(n - 3)),
        }
    }

    /// The numbers below `count` in this order.
    fn of(self, count: u32) -> Vec<u32> {
        let mut all: Vec<u32> = (0..count).collect();
        match self {
            Self::Ascending => {}
            Self::Descending => all.reverse(),
            Self::Shuffled(seed) => {
                // Fisher and Yates, with numbers of a linear congruential generator (Knuth, MMIX).
                let mut state = u64::from(seed);
                for i in (1..all.len()).rev() {
                    state = state
                        .wrapping_mul(6_364_136_223_846_793_005)
                        .wrapping_add(1_442_695_040_888_963_407);
                    all.swap(i, (state >> 33) as usize % (i + 1));
                }
            }
        }
        all
    }
}

impl fmt::Display for Order {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ascending => write!(f, "in ascending order"),
            Self::Descending => write!(f, "in descending order"),
            Self::Shuffled(seed) => write!(f, "shuffled with seed {seed}"),
        }
    }
}

/// What is done with a word.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Read.
    Read,
    /// Written.
    Write,
    /// Read, and perhaps written, by an atomic operation.
    Atomic,
    /// Overwritten by an atomic operation.
    AtomicStore,
}

impl Access {
    const fn verb(self) -> &'static str {
        match self {
            Self::Read => "reads",
            Self::Write | Self::AtomicStore => "writes",
            Self::Atomic => "changes",
        }
    }

    const fn is_atomic(self) -> bool {
        matches!(self, Self::Atomic | Self::AtomicStore)
    }
}

/// Which memory a word belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// Buffers of a call.
    Storage,
    /// Memory of a workgroup.
    Workgroup,
    /// Textures of a call. No barrier orders them.
    Texture,
}

/// An access that was made.
#[derive(Clone, Copy)]
struct Made {
    access: Access,
    at: UVec3,
    group: u32,
    /// Barriers that its workgroup had passed which order this memory.
    barriers: u32,
    place: &'static Location<'static>,
}

impl Made {
    /// Whether nothing orders two accesses that must be ordered.
    fn races(&self, later: &Self) -> bool {
        self.at != later.at
            && (self.access, later.access) != (Access::Read, Access::Read)
            && !(self.access.is_atomic() && later.access.is_atomic())
            && (self.group != later.group || self.barriers == later.barriers)
    }
}

/// What is known of a word.
#[derive(Clone, Copy, Default)]
struct Word {
    written: Option<Made>,
    /// The last read; the last one of another invocation; the last one of another workgroup.
    read: [Option<Made>; 3],
}

impl Word {
    fn remember(&mut self, made: Made) {
        if made.access != Access::Read {
            self.written = Some(made);
            return;
        }
        if let Some(last) = self.read[0] {
            if last.at != made.at {
                self.read[1] = Some(last);
            }
            if last.group != made.group {
                self.read[2] = Some(last);
            }
        }
        self.read[0] = Some(made);
    }
}

/// Memory with a name.
struct Memory {
    name: &'static str,
    start: usize,
    end: usize,
    element: usize,
}

/// What a session knows.
struct Session {
    order: Order,
    storage: HashMap<usize, Word>,
    shared: HashMap<usize, Word>,
    memories: Vec<Memory>,
    at: UVec3,
    group: u32,
    /// Barriers that the workgroup has passed: for workgroup memory, for storage.
    barriers: [u32; 3],
    /// Where the invocation wrote memory first.
    wrote: Option<&'static Location<'static>>,
}

/// How many sessions there are, on any thread.
static SESSIONS: AtomicU32 = AtomicU32::new(0);

thread_local! {
    static SESSION: RefCell<Option<Session>> = const { RefCell::new(None) };
    /// Where the last panic of a session came from.
    static PANICKED: RefCell<Option<String>> = const { RefCell::new(None) };
}

/// What this thread does is looked at, until it is dropped.
#[doc(hidden)]
#[derive(Debug)]
pub struct Open(());

impl Drop for Open {
    fn drop(&mut self) {
        SESSION.set(None);
        SESSIONS.fetch_sub(1, Relaxed);
    }
}

/// How a call is run, and its session if it is sanitized.
#[doc(hidden)]
#[must_use]
pub fn begin(mode: Mode) -> (Mode, Option<Open>) {
    let Some(order) = mode.sanitize else {
        return (mode, None);
    };
    keep_places();
    PANICKED.set(None);
    SESSION.set(Some(Session {
        order,
        storage: HashMap::new(),
        shared: HashMap::new(),
        memories: Vec::new(),
        at: UVec3::ZERO,
        group: 0,
        barriers: [0; 3],
        wrote: None,
    }));
    SESSIONS.fetch_add(1, Relaxed);
    let mode = Mode::sanitized(order).in_subgroups_of(mode.subgroup_size);
    (mode, Some(Open(())))
}

/// Has the place of a panic kept in sessions, instead of printed.
fn keep_places() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            if here() {
                PANICKED.set(info.location().map(|at| match called_from(at.file()) {
                    Some(line) => format!("{at}, called from {line}"),
                    None => at.to_string(),
                }));
            } else {
                before(info);
            }
        }));
    });
}

/// The line of the author's that led into a file of somebody else: of `core`, or of a crate from a registry. Only known
/// where the kernels' crate has been compiled with lines.
fn called_from(file: &str) -> Option<String> {
    // The standard library, as it is distributed and as sources; crates of a registry and of git.
    let is_foreign = |file: &str| {
        file.starts_with("/rustc/")
            || ["/library/core/", "/library/alloc/", "/library/std/"]
                .iter()
                .chain(&["/registry/src/", "/git/checkouts/"])
                .any(|within| file.contains(within))
    };
    if !is_foreign(file) {
        return None;
    }
    let own = env!("CARGO_MANIFEST_DIR");
    let trace = Backtrace::force_capture().to_string();
    let mut places = trace
        .lines()
        .filter_map(|line| line.trim().strip_prefix("at "));
    // What is foreign, after the first of it.
    let found = places.find(|at| !is_foreign(at) && !at.contains(own) && at.contains(".rs:"));
    found.map(|at| at.strip_prefix("./").unwrap_or(at).into())
}

/// Where the last panic of this thread's session came from.
pub(super) fn panicked_at() -> Option<String> {
    PANICKED.take()
}

/// Whether this thread is in a session.
#[inline]
fn here() -> bool {
    SESSIONS.load(Relaxed) != 0 && SESSION.with_borrow(Option::is_some)
}

/// The numbers below `count` in the order of the session; none outside of one.
pub(super) fn order(count: usize) -> Option<Vec<u32>> {
    if SESSIONS.load(Relaxed) == 0 {
        return None;
    }
    let order = SESSION.with_borrow(|session| session.as_ref().map(|s| s.order))?;
    Some(order.of(u32::try_from(count).ok()?))
}

fn with(f: impl FnOnce(&mut Session)) {
    if SESSIONS.load(Relaxed) != 0 {
        SESSION.with_borrow_mut(|session| session.as_mut().map(f));
    }
}

/// Gives memory a name: `element` bytes are one of its elements.
pub(super) fn name<T>(name: &'static str, memory: &[T], element: usize) {
    with(|session| {
        let range = memory.as_ptr_range();
        let (start, end) = (range.start as usize, range.end as usize);
        session
            .memories
            .retain(|m| m.end <= start || end <= m.start);
        session.memories.push(Memory {
            name,
            start,
            end,
            element,
        });
    });
}

/// A workgroup begins: its memory holds nothing.
pub(super) fn begin_group(number: u32) {
    with(|session| {
        session.group = number;
        session.barriers = [0; 3];
        session.shared.clear();
    });
}

/// The invocation at `at` goes on.
#[inline]
pub(super) fn enter(at: UVec3) {
    with(|session| session.at = at);
}

/// An invocation without a workgroup goes on: each is in one of its own.
#[inline]
pub(super) fn enter_alone(at: UVec3, number: u32) {
    with(|session| {
        session.at = at;
        session.group = number;
        session.wrote = None;
    });
}

/// Where the invocation that [`enter_alone`] was called for wrote memory first, in a session.
pub(super) fn wrote() -> Option<&'static Location<'static>> {
    if SESSIONS.load(Relaxed) == 0 {
        return None;
    }
    SESSION.with_borrow(|session| session.as_ref()?.wrote)
}

/// All invocations of the workgroup have passed a barrier, which orders `space`.
pub(super) fn passed(space: Space) {
    with(|session| session.barriers[space as usize] += 1);
}

/// Looks at an access to words.
#[inline(always)]
pub(crate) fn look<T>(
    space: Space,
    access: Access,
    words: &[T],
    place: &'static Location<'static>,
) {
    if SESSIONS.load(Relaxed) != 0 {
        looked(space, access, words.as_ptr_range(), place);
    }
}

/// Looks whether a texel is there that is read without a sampler.
#[inline(always)]
pub(crate) fn look_for_texel(
    texture: &TextureRef<'_>,
    at: [u32; 3],
    layer: u32,
    level: u32,
    sample: u32,
    place: &'static Location<'static>,
) {
    if SESSIONS.load(Relaxed) != 0 {
        looked_for_texel(texture, at, layer, level, sample, place);
    }
}

#[cold]
#[inline(never)]
fn looked_for_texel(
    texture: &TextureRef<'_>,
    at: [u32; 3],
    layer: u32,
    level: u32,
    sample: u32,
    place: &'static Location<'static>,
) {
    let size = level_size(texture.size, level.min(texture.levels - 1));
    let is_there = level < texture.levels
        && layer < texture.layers
        && sample < texture.samples
        && (0..3).all(|d| at[d] < size[d]);
    let Some(reader) = SESSION
        .with_borrow(|session| Some(session.as_ref()?.at))
        .filter(|_| !is_there)
    else {
        return;
    };
    let [width, height, depth] = size;
    refuse(format!(
        "{} reads texel {at:?} of layer {layer}, level {level}, sample {sample}, at {place}: the texture has {} layers, {} levels and {} samples, and {width} x {height} x {depth} texels there; what is read beyond differs from device to device",
        invocation(reader),
        texture.layers,
        texture.levels,
        texture.samples,
    ));
}

/// A cube is sampled in no direction.
#[cold]
#[inline(never)]
pub(crate) fn no_direction() {
    if SESSIONS.load(Relaxed) == 0 {
        return;
    }
    if let Some(reader) = SESSION.with_borrow(|session| Some(session.as_ref()?.at)) {
        refuse(format!(
            "{} samples a cube in the direction (0, 0, 0), for which a device may read anything: give it another one, \
             `if v == Vec3::ZERO {{ Vec3::Z }} else {{ v }}`",
            invocation(reader)
        ));
    }
}

#[cold]
#[inline(never)]
fn looked<T>(
    space: Space,
    access: Access,
    words: Range<*const T>,
    place: &'static Location<'static>,
) {
    let fault = SESSION.with_borrow_mut(|session| {
        let session = session.as_mut()?;
        if access != Access::Read {
            session.wrote.get_or_insert(place);
        }
        let made = Made {
            access,
            at: session.at,
            group: session.group,
            barriers: session.barriers[space as usize],
            place,
        };
        let (start, end) = (words.start as usize, words.end as usize);
        (start..end)
            .step_by(4)
            .find_map(|word| session.fault(space, word, made))
    });
    if let Some(fault) = fault {
        refuse(fault);
    }
}

impl Session {
    /// What is wrong with an access, which is remembered.
    fn fault(&mut self, space: Space, address: usize, made: Made) -> Option<String> {
        let words = match space {
            Space::Storage | Space::Texture => &mut self.storage,
            Space::Workgroup => &mut self.shared,
        };
        let word = words.entry(address).or_default();
        let earlier = word.written.iter().chain(word.read.iter().flatten());
        let race = earlier.copied().find(|earlier| earlier.races(&made));
        let reads = matches!(made.access, Access::Read | Access::Atomic);
        let unwritten = space == Space::Workgroup && reads && word.written.is_none();
        word.remember(made);
        if let Some(earlier) = race {
            return Some(self.race(space, address, earlier, made));
        }
        unwritten.then(|| {
            format!(
                "{} {} {}, at {}, before anything was written to it: workgroup memory starts with any content; if another invocation writes it, put a barrier() between the two",
                invocation(made.at),
                made.access.verb(),
                self.element(address),
                made.place
            )
        })
    }

    fn race(&self, space: Space, address: usize, earlier: Made, made: Made) -> String {
        let cure = match space {
            _ if earlier.group != made.group => {
                "only a barrier within a workgroup orders accesses: use Atomics, or give each its own elements"
            }
            Space::Workgroup => "put a barrier() between the two",
            Space::Storage => "put a storage_barrier() between the two, or use Atomics",
            Space::Texture => {
                "no barrier orders texels: give each invocation its own, or use a StorageMut"
            }
        };
        format!(
            "data race: {} {} {}, at {}, and {} {} it, at {}, in no certain order; {cure}",
            invocation(earlier.at),
            earlier.access.verb(),
            self.element(address),
            earlier.place,
            invocation(made.at),
            made.access.verb(),
            made.place,
        )
    }

    /// What lies at an address.
    fn element(&self, address: usize) -> String {
        let memory = self
            .memories
            .iter()
            .find(|m| (m.start..m.end).contains(&address));
        match memory {
            Some(m) => format!(
                "element {} of `{}`",
                (address - m.start) / m.element,
                m.name
            ),
            None => "memory".into(),
        }
    }
}

fn invocation(at: UVec3) -> String {
    format!("invocation ({}, {}, {})", at.x, at.y, at.z)
}

/// Ends the call with these words: they say where it happened.
pub(crate) fn refuse(message: String) -> ! {
    panic::resume_unwind(Box::new(message))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_order_has_every_number_once() {
        for order in [Order::Ascending, Order::Descending, Order::Shuffled(7)] {
            assert_eq!(Order::of_code(order.code()), Some(order));
            let mut all = order.of(100);
            assert_eq!(all[0] == 0, order == Order::Ascending);
            all.sort_unstable();
            assert!(all.iter().copied().eq(0..100));
        }
        assert_eq!(Order::of_code(0), None);
        assert_ne!(Order::Shuffled(1).of(100), Order::Shuffled(2).of(100));
    }

    #[test]
    fn accesses_race_unless_something_orders_them() {
        let made = |access, x, group, barriers| Made {
            access,
            at: UVec3::new(x, 0, 0),
            group,
            barriers,
            place: Location::caller(),
        };
        let write = made(Access::Write, 0, 0, 0);
        for (later, races) in [
            (made(Access::Read, 0, 0, 0), false),
            (made(Access::Read, 1, 0, 0), true),
            (made(Access::Write, 1, 0, 0), true),
            (made(Access::Atomic, 1, 0, 0), true),
            (made(Access::Read, 1, 0, 1), false),
            (made(Access::Read, 1, 1, 1), true),
        ] {
            assert_eq!(write.races(&later), races);
        }
        let (read, atomic) = (made(Access::Read, 0, 0, 0), made(Access::Atomic, 0, 0, 0));
        assert!(!read.races(&made(Access::Read, 1, 0, 0)));
        assert!(!atomic.races(&made(Access::Atomic, 1, 0, 0)));
    }

    #[test]
    fn a_read_of_another_workgroup_is_not_forgotten() {
        let mut word = Word::default();
        let made = |access, x, group| Made {
            access,
            at: UVec3::new(x, 0, 0),
            group,
            barriers: 0,
            place: Location::caller(),
        };
        for (x, group) in [(0, 0), (64, 1), (65, 1), (64, 1)] {
            word.remember(made(Access::Read, x, group));
        }
        let later = Made {
            barriers: 1,
            ..made(Access::Write, 64, 1)
        };
        let reads: Vec<&Made> = word.read.iter().flatten().collect();
        assert!(reads.iter().any(|r| r.races(&later)));
    }
}
