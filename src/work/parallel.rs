//! The one place where work is spread over threads.
//!
//! Enters: a number of items, or a slice of them, and a closure for one item. Leaves: what the closure gave,
//! in index order. Each item goes to exactly one call of the closure, so results never depend on the number
//! of threads. That number is the one of the rayon pool in which the call runs
//! (`rayon::ThreadPool::install`).
//!
//! Items are dealt out in blocks, which idle threads steal one by one. Only `on_all_threads` and `both` touch
//! rayon, and neither is generic: rayon's trees of jobs are compiled once, not for each closure of the
//! program.

use rayon::prelude::*;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Below this many items the closure runs on the calling thread: handing work out costs more than
/// it saves.
const SERIAL_BELOW: usize = 2;

/// Most blocks for each thread. With fewer of them threads wait at the end for a block of costly items; more
/// of them cost more locks and lists than they save.
const BLOCKS_A_THREAD: usize = 64;

/// `f(0), f(1), … f(n - 1)`, in that order, computed on all threads.
pub fn map<T: Send>(n: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    if n < SERIAL_BELOW {
        return (0..n).map(f).collect();
    }
    let blocks = Blocks::of(n);
    let found = blocks.empty_lists();
    on_all_threads(blocks.count, &|block| {
        *locked(&found[block]) = blocks.items(block).map(&f).collect();
    });
    joined(found, n)
}

/// Threads of the pool in which the call runs.
pub fn threads() -> usize {
    rayon::current_num_threads()
}

/// The results of two pieces of work of different kinds, done at the same time where a thread is
/// free.
pub fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    let (mut a, mut b) = (Some(a), Some(b));
    let (mut of_a, mut of_b) = (None, None);
    both(&mut || of_a = a.take().map(|a| a()), &mut || of_b = b.take().map(|b| b()));
    match (of_a, of_b) {
        (Some(a), Some(b)) => (a, b),
        _ => unreachable!("both closures have run"),
    }
}

/// As [`map`], stopping at the first error found (which of several errors is returned is the one
/// with the smallest index among those computed).
///
/// # Errors
/// The error of the closure.
pub fn try_map<T: Send, E: Send>(
    n: usize,
    f: impl Fn(usize) -> Result<T, E> + Sync + Send,
) -> Result<Vec<T>, E> {
    if n < SERIAL_BELOW {
        return (0..n).map(f).collect();
    }
    let blocks = Blocks::of(n);
    let found = blocks.empty_lists();
    let failure = Failure::none();
    on_all_threads(blocks.count, &|block| {
        *locked(&found[block]) = failure.until_one(blocks.items(block), &f);
    });
    failure.or(|| joined(found, n))
}

/// Calls `f(k, chunk)` on the `k`-th run of `chunk_len` items (the last one may be shorter).
pub fn for_each_chunk<T: Send>(items: &mut [T], chunk_len: usize, f: impl Fn(usize, &mut [T]) + Sync + Send) {
    let chunk_len = chunk_len.max(1);
    let blocks = Blocks::of(items.len().div_ceil(chunk_len));
    let slices = slices(items, blocks.len.saturating_mul(chunk_len));
    on_all_threads(blocks.count, &|block| {
        let mut slice = locked(&slices[block]);
        for (k, chunk) in blocks.items(block).zip(slice.chunks_mut(chunk_len)) {
            f(k, chunk);
        }
    });
}

/// `f(k, item)` of every item, in order, stopping at the first error found, which is chosen as by
/// [`try_map`].
///
/// # Errors
/// The error of the closure.
pub fn try_map_mut<I: Send, T: Send, E: Send>(
    items: &mut [I],
    f: impl Fn(usize, &mut I) -> Result<T, E> + Sync + Send,
) -> Result<Vec<T>, E> {
    let (n, blocks) = (items.len(), Blocks::of(items.len()));
    let found = blocks.empty_lists();
    let failure = Failure::none();
    let slices = slices(items, blocks.len);
    on_all_threads(blocks.count, &|block| {
        let first = blocks.items(block).start;
        let mut slice = locked(&slices[block]);
        *locked(&found[block]) = failure.until_one(blocks.items(block), |k| f(k, &mut slice[k - first]));
    });
    failure.or(|| joined(found, n))
}

/// Calls `f(k, item)` on every item, stopping at the first error found, which is chosen as by [`try_map`].
///
/// # Errors
/// The error of the closure.
pub fn try_for_each<T: Send, E: Send>(
    items: &mut [T],
    f: impl Fn(usize, &mut T) -> Result<(), E> + Sync + Send,
) -> Result<(), E> {
    try_map_mut(items, f).map(|_| ())
}

/// Calls `work(0), … work(count - 1)`, in no certain order, on the threads of the pool; each call can be
/// stolen.
fn on_all_threads(count: usize, work: &(dyn Fn(usize) + Sync)) {
    (0..count).into_par_iter().with_max_len(1).for_each(work);
}

/// Calls both, at the same time where a thread is free.
fn both(a: &mut (dyn FnMut() + Send), b: &mut (dyn FnMut() + Send)) {
    rayon::join(a, b);
}

/// Items dealt out to threads: runs of `len` items, the last one may be shorter.
struct Blocks {
    items: usize,
    len: usize,
    count: usize,
}

impl Blocks {
    /// As many blocks of `items` as serve the pool's threads.
    fn of(items: usize) -> Self {
        let most = BLOCKS_A_THREAD * rayon::current_num_threads();
        let len = items.div_ceil(most).max(1);
        Self { items, len, count: items.div_ceil(len) }
    }

    /// The items of a block.
    fn items(&self, block: usize) -> Range<usize> {
        block * self.len..self.items.min((block + 1) * self.len)
    }

    /// A list for what each block gives.
    fn empty_lists<T>(&self) -> Vec<Mutex<Vec<T>>> {
        (0..self.count).map(|_| Mutex::default()).collect()
    }
}

/// Slices of `len` items for the blocks.
fn slices<T>(items: &mut [T], len: usize) -> Vec<Mutex<&mut [T]>> {
    items.chunks_mut(len).map(Mutex::new).collect()
}

/// One list of all `n` results.
fn joined<T>(lists: Vec<Mutex<Vec<T>>>, n: usize) -> Vec<T> {
    let mut all = Vec::with_capacity(n);
    for list in lists {
        all.append(&mut list.into_inner().unwrap_or_else(PoisonError::into_inner));
    }
    all
}

/// What a lock guards. A closure that panics ends the whole call, so nothing half done is ever read.
fn locked<T>(lock: &Mutex<T>) -> MutexGuard<'_, T> {
    lock.lock().unwrap_or_else(PoisonError::into_inner)
}

/// The error with the smallest index among those found.
struct Failure<E> {
    found: AtomicBool,
    first: Mutex<Option<(usize, E)>>,
}

impl<E> Failure<E> {
    fn none() -> Self {
        Self { found: AtomicBool::new(false), first: Mutex::new(None) }
    }

    /// What `f` gives for the items, as far as no error is found here or by another thread.
    fn until_one<T>(&self, items: Range<usize>, mut f: impl FnMut(usize) -> Result<T, E>) -> Vec<T> {
        let mut done = Vec::with_capacity(items.len());
        for k in items {
            if self.found.load(Ordering::Relaxed) {
                break;
            }
            match f(k) {
                Ok(result) => done.push(result),
                Err(error) => self.note(k, error),
            }
        }
        done
    }

    fn note(&self, k: usize, error: E) {
        let mut first = locked(&self.first);
        if first.as_ref().is_none_or(|&(index, _)| k < index) {
            *first = Some((k, error));
        }
        self.found.store(true, Ordering::Relaxed);
    }

    /// The error, or the results where there is none.
    fn or<T>(self, results: impl FnOnce() -> T) -> Result<T, E> {
        match self.first.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Some((_, error)) => Err(error),
            None => Ok(results()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::AtomicUsize;

    /// Around the numbers of items at which blocks grow.
    const COUNTS: [usize; 7] = [0, 1, 2, 63, 128, 129, 5000];

    fn pools() -> impl Iterator<Item = rayon::ThreadPool> {
        [1, 2, 5].into_iter().map(|n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap())
    }

    #[test]
    fn results_come_in_order_on_any_number_of_threads() {
        for pool in pools() {
            for n in COUNTS {
                let squares: Vec<usize> = (0..n).map(|k| k * k).collect();
                assert_eq!(pool.install(|| map(n, |k| k * k)), squares);
                assert_eq!(pool.install(|| try_map(n, |k| Ok::<_, ()>(k * k))), Ok(squares));
            }
        }
    }

    #[test]
    fn every_item_is_handed_out_once_with_its_index() {
        for pool in pools() {
            for n in COUNTS {
                let mut items = vec![0; n];
                let doubled = pool.install(|| {
                    try_map_mut(&mut items, |k, item| {
                        *item += k;
                        Ok::<_, ()>(2 * *item)
                    })
                });
                assert_eq!(items, (0..n).collect::<Vec<_>>());
                assert_eq!(doubled, Ok((0..n).map(|k| 2 * k).collect()));
            }
        }
    }

    #[test]
    fn chunks_have_their_length_but_for_the_last() {
        for pool in pools() {
            for n in COUNTS {
                for len in [0, 1, 3, 7000] {
                    let mut items = vec![usize::MAX; n];
                    pool.install(|| for_each_chunk(&mut items, len, |k, chunk| chunk.fill(k)));
                    assert_eq!(items, (0..n).map(|item| item / len.max(1)).collect::<Vec<_>>());
                }
            }
        }
    }

    #[test]
    fn an_error_ends_the_work() {
        for pool in pools() {
            let calls = AtomicUsize::new(0);
            let found = pool.install(|| {
                try_map(5000, |k| {
                    calls.fetch_add(1, Ordering::Relaxed);
                    if k >= 40 { Err(k) } else { Ok(k) }
                })
            });
            let calls = calls.into_inner();
            assert!(found.is_err_and(|k| k >= 40));
            assert!(calls < 5000, "{calls} calls");
        }
    }

    #[test]
    fn the_least_index_among_the_errors_wins() {
        let failure = Failure::none();
        for k in [7, 3, 5] {
            failure.note(k, k);
        }
        assert_eq!(failure.or(|| ()), Err(3));
        let mut items = [0; 300];
        let one = try_for_each(&mut items, |k, _| if k == 299 { Err(k) } else { Ok(()) });
        assert_eq!(one, Err(299));
    }

    #[test]
    fn calls_may_be_nested() {
        for pool in pools() {
            let sums = pool.install(|| map(50, |k| map(k, |i| i).into_iter().sum::<usize>()));
            assert_eq!(sums, (0..50).map(|k: usize| k * k.saturating_sub(1) / 2).collect::<Vec<_>>());
            assert_eq!(pool.install(|| join(|| join(|| 1, || "b"), || 3.0)), ((1, "b"), 3.0));
        }
    }
}
