//! Sparse symmetric positive definite systems, solved directly on the calling thread.
//!
//! Enters: the entries of one half of the matrix and right sides. Leaves: the solutions. The order of
//! elimination is approximate minimum degree; one thread, so that the bits do not depend on how many
//! there are.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{
    LltRef, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMat, Triplet};
use faer::traits::ComplexField;
use faer::{Conj, MatMut, Par, Side};

/// An entry on or below the diagonal.
pub(super) type Entry<T> = Triplet<u32, u32, T>;

/// The Cholesky factor of a matrix, for any number of right sides.
pub(super) struct Factor<T> {
    symbolic: SymbolicCholesky<u32>,
    values: Vec<T>,
}

/// What solving takes, one for each thread that solves.
pub(super) struct Scratch(MemBuffer);

impl<T: ComplexField> Factor<T> {
    /// Of the (Hermitian) matrix of `n` rows that has the sums of the given `entries` on and below its
    /// diagonal. `None` where it is not positive definite or too large.
    pub fn new(n: usize, entries: &[Entry<T>]) -> Option<Self> {
        let matrix = SparseColMat::<u32, T>::try_new_from_triplets(n, n, entries).ok()?;
        let ordering = SymmetricOrdering::Amd;
        let symbolic =
            factorize_symbolic_cholesky(matrix.symbolic(), Side::Lower, ordering, Default::default()).ok()?;
        let mut values = vec![T::zero_impl(); symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<T>(Par::Seq, Default::default());
        let mut memory = MemBuffer::try_new(scratch).ok()?;
        symbolic
            .factorize_numeric_llt::<T>(
                &mut values,
                matrix.as_ref(),
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .ok()?;
        Some(Self { symbolic, values })
    }

    /// What [`Factor::solve`] takes; `None` where that is not to be had.
    pub fn scratch(&self) -> Option<Scratch> {
        MemBuffer::try_new(self.symbolic.solve_in_place_scratch::<T>(1, Par::Seq)).ok().map(Scratch)
    }

    /// Solves in place of a right side, which has a number for each row.
    pub fn solve(&self, scratch: &mut Scratch, b: &mut [T]) {
        let n = b.len();
        LltRef::<'_, u32, T>::new(&self.symbolic, &self.values).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(b, n, 1),
            Par::Seq,
            MemStack::new(&mut scratch.0),
        );
    }
}

/// Solves one system in place of its right side; see [`Factor::new`].
pub(super) fn solve<T: ComplexField>(entries: &[Entry<T>], b: &mut [T]) -> Option<()> {
    if !b.is_empty() {
        let factor = Factor::new(b.len(), entries)?;
        factor.solve(&mut factor.scratch()?, b);
    }
    Some(())
}
