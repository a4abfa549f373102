//! Work that waits for other processes, as much at a time as the memory allows.
//!
//! These threads calculate nothing, so they are no part of `work::parallel`.

use std::sync::{Condvar, Mutex, PoisonError};

/// What is left to do.
struct State {
    waiting: Vec<usize>,
    free_mib: u64,
}

/// Does `work` for every number of `claims`, up to `jobs` at a time, as long as their claims (MiB) together
/// are within `budget_mib`. A claim beyond the budget counts as all of it, and so runs alone. Earlier ones
/// start first where they fit. Leaves the answers in order.
pub fn run_all<T: Send>(
    jobs: usize,
    budget_mib: u64,
    claims: &[u64],
    work: impl Fn(usize) -> T + Sync,
) -> Vec<T> {
    let state = Mutex::new(State { waiting: (0..claims.len()).collect(), free_mib: budget_mib });
    let changed = Condvar::new();
    let claim = |number: usize| claims[number].min(budget_mib);
    let lock = || state.lock().unwrap_or_else(PoisonError::into_inner);
    // The first that fits; `None` when nothing is left.
    let take = || {
        let mut state = lock();
        while !state.waiting.is_empty() {
            let free = state.free_mib;
            if let Some(place) = state.waiting.iter().position(|&number| claim(number) <= free) {
                let number = state.waiting.remove(place);
                state.free_mib -= claim(number);
                return Some(number);
            }
            state = changed.wait(state).unwrap_or_else(PoisonError::into_inner);
        }
        None
    };
    let answers = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..jobs.clamp(1, claims.len().max(1)) {
            scope.spawn(|| {
                while let Some(number) = take() {
                    let answer = work(number);
                    answers.lock().unwrap_or_else(PoisonError::into_inner).push((number, answer));
                    lock().free_mib += claim(number);
                    changed.notify_all();
                }
            });
        }
    });
    let mut answers = answers.into_inner().unwrap_or_else(PoisonError::into_inner);
    answers.sort_by_key(|(number, _)| *number);
    answers.into_iter().map(|(_, answer)| answer).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU64, Ordering};

    #[test]
    fn the_claims_stay_within_the_budget_and_all_is_done() {
        let claims = [3, 9, 1, 4, 20, 2, 2];
        let (taken, most) = (AtomicU64::new(0), AtomicU64::new(0));
        let answers = run_all(4, 9, &claims, |number| {
            let claim = claims[number].min(9);
            most.fetch_max(taken.fetch_add(claim, Ordering::SeqCst) + claim, Ordering::SeqCst);
            std::thread::yield_now();
            taken.fetch_sub(claim, Ordering::SeqCst);
            number
        });
        assert_eq!(answers, [0, 1, 2, 3, 4, 5, 6]);
        assert!(most.into_inner() <= 9);
        assert!(run_all(4, 9, &[], |number| number).is_empty());
    }
}
