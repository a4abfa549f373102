//! Sparse symmetric positive definite systems, solved directly on the calling thread.
//!
//! Enters: the entries of one half of the matrix and the right-hand side. Leaves: the solution. The
//! order of elimination is approximate minimum degree; one thread, so that the bits do not depend on
//! how many there are.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{LltRef, SymmetricOrdering, factorize_symbolic_cholesky};
use faer::sparse::{SparseColMat, Triplet};
use faer::traits::ComplexField;
use faer::{Conj, MatMut, Par, Side};

/// An entry on or below the diagonal.
pub(super) type Entry<T> = Triplet<u32, u32, T>;

/// Solves `A x = b` in place of `b`, where `A` (Hermitian) has the sums of the given `entries` on and
/// below its diagonal. `None` where `A` is not positive definite or too large.
pub(super) fn solve<T: ComplexField>(entries: &[Entry<T>], b: &mut [T]) -> Option<()> {
    let n = b.len();
    if n == 0 {
        return Some(());
    }
    let matrix = SparseColMat::<u32, T>::try_new_from_triplets(n, n, entries).ok()?;
    let ordering = SymmetricOrdering::Amd;
    let symbolic =
        factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, ordering, Default::default()).ok()?;
    let zero = b[0].clone();
    let mut factor = vec![zero; symbolic.len_val()];
    let scratch = symbolic.factorize_numeric_llt_scratch::<T>(Par::Seq, Default::default());
    let mut memory = MemBuffer::try_new(scratch).ok()?;
    symbolic
        .factorize_numeric_llt::<T>(
            &mut factor,
            matrix.as_ref(),
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        )
        .ok()?;
    let mut memory = MemBuffer::try_new(symbolic.solve_in_place_scratch::<T>(1, Par::Seq)).ok()?;
    LltRef::<'_, u32, T>::new(&symbolic, &factor).solve_in_place_with_conj(
        Conj::No,
        MatMut::from_column_major_slice_mut(b, n, 1),
        Par::Seq,
        MemStack::new(&mut memory),
    );
    Some(())
}
