//! The numbers in which the plant's laws are written: one `f64`, or several side by side in the lanes of one register.
//!
//! A law that is written over [`Real`] exists once and serves a single twin as well as a batch of them. Where it branches,
//! `either!` takes the branch of a single number; of lanes it computes one branch if all agree, and both if they differ.
//! Each lane has the operations of a single number, in the same order, so that results are equal to the last bit.
//! Everything here and every law written over it must be inlined into the function that is compiled for the lanes' instructions: a call out
//! of it would be compiled for the oldest processor. Hence `inline(always)` throughout, on closures as well.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

/// A real number, or several side by side.
pub trait Real:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + Add<f64, Output = Self>
    + Sub<f64, Output = Self>
    + Mul<f64, Output = Self>
    + Div<f64, Output = Self>
{
    /// A truth value for each.
    type Mask: Truth<Self>;

    /// A constant, in as many lanes as this number has.
    #[must_use]
    fn like(self, value: f64) -> Self;
    /// The square root.
    #[must_use]
    fn sqrt(self) -> Self;
    /// The absolute value.
    #[must_use]
    fn abs(self) -> Self;
    /// This size with the sign of another number.
    #[must_use]
    fn copysign(self, sign: Self) -> Self;
    /// The greater of the two; the other where this one is not a number.
    #[must_use]
    fn max(self, other: Self) -> Self;
    /// The less of the two; the other where this one is not a number.
    #[must_use]
    fn min(self, other: Self) -> Self;
    /// Held between two limits; not a number stays so.
    #[must_use]
    fn clamp(self, min: Self, max: Self) -> Self;
    /// The exponential; in masked lanes the result is not used and may be any value.
    #[must_use]
    fn exp_unless(self, unwanted: Self::Mask) -> Self;
    /// Whether it equals another.
    fn eq(self, other: Self) -> Self::Mask;
    /// Whether it is less than another.
    fn lt(self, other: Self) -> Self::Mask;
    /// Whether it is less than another or equal.
    fn le(self, other: Self) -> Self::Mask;
    /// The first number where a mask holds, the second elsewhere.
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self;

    /// Whether it is greater than another.
    #[inline(always)]
    fn gt(self, other: Self) -> Self::Mask {
        other.lt(self)
    }

    /// Whether it is greater than another or equal.
    #[inline(always)]
    fn ge(self, other: Self) -> Self::Mask {
        other.le(self)
    }

    /// Whether it equals a constant.
    #[inline(always)]
    fn is(self, value: f64) -> Self::Mask {
        self.eq(self.like(value))
    }
}

/// A truth value for each of some numbers.
pub trait Truth<T: Real<Mask = Self>>: Copy + BitAnd<Output = Self> + BitOr<Output = Self> {
    /// Whether it holds anywhere.
    fn any(self) -> bool;
    /// Whether it holds everywhere.
    fn all(self) -> bool;

    /// The first result where the mask holds, the second elsewhere; a result that no lane uses is not computed.
    #[inline(always)]
    fn either<R: Lanewise<T>>(self, yes: impl FnOnce() -> R, no: impl FnOnce() -> R) -> R {
        if self.all() {
            yes()
        } else if self.any() {
            R::choose(self, yes(), no())
        } else {
            no()
        }
    }
}

/// [`Truth::either`] of two expressions, of which only the needed ones are computed.
macro_rules! either {
    ($mask:expr, $yes:expr, $no:expr $(,)?) => {
        $crate::plant::real::Truth::either(
            $mask,
            #[inline(always)]
            || $yes,
            #[inline(always)]
            || $no,
        )
    };
}

pub(crate) use either;

/// What can be chosen lane by lane.
pub trait Lanewise<T: Real> {
    /// The first where a mask holds, the second elsewhere.
    fn choose(mask: T::Mask, yes: Self, no: Self) -> Self;
}

impl<T: Real> Lanewise<T> for T {
    #[inline(always)]
    fn choose(mask: T::Mask, yes: Self, no: Self) -> Self {
        T::select(mask, yes, no)
    }
}

impl<T: Real> Lanewise<T> for (T, T) {
    #[inline(always)]
    fn choose(mask: T::Mask, yes: Self, no: Self) -> Self {
        (T::select(mask, yes.0, no.0), T::select(mask, yes.1, no.1))
    }
}

/// Methods that a number has of its own.
macro_rules! own {
    ($($method:ident($($other:ident),*)),*) => {$(
        #[inline(always)]
        fn $method(self $(, $other: Self)*) -> Self {
            self.$method($($other),*)
        }
    )*};
}

impl Real for f64 {
    type Mask = bool;

    #[inline(always)]
    fn like(self, value: f64) -> Self {
        value
    }

    own!(sqrt(), abs(), copysign(sign), max(other), min(other), clamp(min, max));

    #[inline(always)]
    fn exp_unless(self, _unwanted: bool) -> Self {
        self.exp()
    }

    #[inline(always)]
    fn eq(self, other: Self) -> bool {
        self == other
    }

    #[inline(always)]
    fn lt(self, other: Self) -> bool {
        self < other
    }

    #[inline(always)]
    fn le(self, other: Self) -> bool {
        self <= other
    }

    #[inline(always)]
    fn select(mask: bool, yes: Self, no: Self) -> Self {
        if mask { yes } else { no }
    }
}

impl Truth<f64> for bool {
    #[inline(always)]
    fn any(self) -> bool {
        self
    }

    #[inline(always)]
    fn all(self) -> bool {
        self
    }
}
