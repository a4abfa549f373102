//! Vector width picked at run time: one build serves every x86-64 and arm64 machine.
//!
//! Plain loops over arrays of fixed length become vector code for the widest unit found (AVX-512, AVX2, NEON)
//! if they are compiled for it; [`dispatch`] compiles its closure once for each. Nothing in such code fuses a
//! product with a sum, so that every width gives the same bits.
//!
//! Three traps. A closure that is not itself `#[inline(always)]` stays code for the oldest machine, so hot
//! loops call functions. An inner loop keeps the outer one from becoming vector code. A masked store that the
//! next line reads costs a stall.

/// Runs `work`, compiled for the vector unit of this machine. Everything hot that it calls must be
/// `#[inline(always)]`: what is not inlined stays code for the oldest machine.
#[inline(always)]
pub fn dispatch<R>(work: impl FnOnce() -> R) -> R {
    struct Work<F>(F);
    impl<R, F: FnOnce() -> R> pulp::NullaryFnOnce for Work<F> {
        type Output = R;
        #[inline(always)]
        fn call(self) -> R {
            (self.0)()
        }
    }
    pulp::Arch::new().dispatch(Work(work))
}

/// Lanes of the lists that vector loops choose from.
pub const LANES: usize = 16;

/// One bit for each lane that is true, the first one lowest.
#[inline(always)]
pub fn bits(lanes: &[bool; LANES]) -> u32 {
    // An instruction for it keeps what fills the lanes from being taken apart into sixteen scalars.
    #[cfg(target_arch = "x86_64")]
    if let Some(sse2) = pulp::core_arch::x86::Sse2::try_new() {
        let mut signs = [0i8; LANES];
        for lane in 0..LANES {
            signs[lane] = if lanes[lane] { -1 } else { 0 };
        }
        return sse2._mm_movemask_epi8(pulp::cast(signs)) as u32;
    }
    packed(lanes)
}

/// As [`bits`], for any machine.
#[inline(always)]
fn packed(lanes: &[bool; LANES]) -> u32 {
    // Kept in memory, for the same reason.
    let lanes = std::hint::black_box(lanes);
    // The product moves the lowest bits of eight bytes side by side to the top.
    let eight = |k: usize| {
        let bytes = u64::from_le_bytes(std::array::from_fn(|b| u8::from(lanes[k + b])));
        (bytes.wrapping_mul(0x0102_0408_1020_4080) >> 56) as u32
    };
    eight(0) | eight(8) << 8
}

/// The number type of a vector loop: f32 where its rounding is far below what is asked, else f64.
pub trait Real:
    Copy
    + PartialOrd
    + std::ops::Add<Output = Self>
    + std::ops::Sub<Output = Self>
    + std::ops::Mul<Output = Self>
    + std::ops::Div<Output = Self>
    + std::ops::Neg<Output = Self>
    + Send
    + Sync
{
    /// The nearest number of this type.
    fn of(x: f64) -> Self;
    /// The sum with a number that f32 holds exactly, rounded once.
    fn plus(self, x: f64) -> f32;
    /// Square root; NaN of a negative number.
    fn sqrt(self) -> Self;
    /// Without its sign.
    #[inline(always)]
    fn absolute(self) -> Self {
        self.larger(-self)
    }
    /// The larger one; the second one where either is NaN. One machine instruction, which `f64::max` is
    /// not, because that also orders NaN.
    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        if self > other { self } else { other }
    }
    /// The smaller one; the second one where either is NaN.
    #[inline(always)]
    fn smaller(self, other: Self) -> Self {
        if self < other { self } else { other }
    }
}

impl Real for f32 {
    #[inline(always)]
    fn of(x: f64) -> Self {
        x as f32
    }
    #[inline(always)]
    fn plus(self, x: f64) -> f32 {
        self + x as f32
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }
}

impl Real for f64 {
    #[inline(always)]
    fn of(x: f64) -> Self {
        x
    }
    #[inline(always)]
    fn plus(self, x: f64) -> f32 {
        (self + x) as f32
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        f64::sqrt(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_lane_has_its_bit() {
        for number in 0..1u32 << LANES {
            let lanes = std::array::from_fn(|lane| number & (1 << lane) != 0);
            assert_eq!((bits(&lanes), packed(&lanes)), (number, number));
        }
    }
}
