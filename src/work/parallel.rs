//! The one place where work is spread over threads.
//!
//! Every function gives its results in index order and hands each item to exactly one closure
//! call, so that results never depend on the number of threads. The number of threads is that of
//! the rayon pool in which the call runs (`rayon::ThreadPool::install`).

use rayon::prelude::*;

/// Below this many items the closure runs on the calling thread: handing work out costs more than
/// it saves.
const SERIAL_BELOW: usize = 2;

/// `f(0), f(1), … f(n - 1)`, in that order, computed on all threads.
pub fn map<T: Send>(n: usize, f: impl Fn(usize) -> T + Sync + Send) -> Vec<T> {
    if n < SERIAL_BELOW {
        return (0..n).map(f).collect();
    }
    (0..n).into_par_iter().map(f).collect()
}

/// Threads of the pool in which the call runs.
pub fn threads() -> usize {
    rayon::current_num_threads()
}

/// The results of two pieces of work of different kinds, done at the same time where a thread is
/// free.
pub fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    rayon::join(a, b)
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
    (0..n).into_par_iter().map(f).collect()
}

/// Calls `f(k, chunk)` on the `k`-th run of `chunk_len` items (the last one may be shorter).
pub fn for_each_chunk<T: Send>(items: &mut [T], chunk_len: usize, f: impl Fn(usize, &mut [T]) + Sync + Send) {
    items.par_chunks_mut(chunk_len.max(1)).enumerate().for_each(|(k, chunk)| f(k, chunk));
}

/// `f(k, item)` of every item, in order, stopping at the first error found.
///
/// # Errors
/// The error of the closure.
pub fn try_map_mut<I: Send, T: Send, E: Send>(
    items: &mut [I],
    f: impl Fn(usize, &mut I) -> Result<T, E> + Sync + Send,
) -> Result<Vec<T>, E> {
    items.par_iter_mut().enumerate().map(|(k, item)| f(k, item)).collect()
}

/// Calls `f(k, item)` on every item, stopping at the first error found.
///
/// # Errors
/// The error of the closure.
pub fn try_for_each<T: Send, E: Send>(
    items: &mut [T],
    f: impl Fn(usize, &mut T) -> Result<(), E> + Sync + Send,
) -> Result<(), E> {
    items.par_iter_mut().enumerate().try_for_each(|(k, item)| f(k, item))
}
