//! Two registers of lanes as one number: the operations of one fill the latency of the other's quotients and roots.

use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

use crate::plant::lanes::Wide;
use crate::plant::real::{Real, Truth};

/// Two numbers side by side, each of which may be several.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair<T>(pub T, pub T);

impl<T: Wide> Wide for Pair<T> {
    const COUNT: usize = 2 * T::COUNT;

    #[inline(always)]
    fn lane(self, lane: usize) -> f64 {
        if lane < T::COUNT { self.0.lane(lane) } else { self.1.lane(lane - T::COUNT) }
    }

    #[inline(always)]
    fn each(self, mut of: impl FnMut(usize) -> f64) -> Self {
        Self(self.0.each(&mut of), self.1.each(|lane| of(lane + T::COUNT)))
    }
}

/// Truth values of two numbers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Masks<M>(M, M);

impl<T: Real> Truth<Pair<T>> for Masks<T::Mask> {
    #[inline(always)]
    fn any(self) -> bool {
        self.0.any() | self.1.any()
    }

    #[inline(always)]
    fn all(self) -> bool {
        self.0.all() & self.1.all()
    }
}

impl<M: BitAnd<Output = M>> BitAnd for Masks<M> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self(self.0 & other.0, self.1 & other.1)
    }
}

impl<M: BitOr<Output = M>> BitOr for Masks<M> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0, self.1 | other.1)
    }
}

macro_rules! operator {
    ($($operator:ident $method:ident),*) => {$(
        impl<T: Real> $operator for Pair<T> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                Self(self.0.$method(other.0), self.1.$method(other.1))
            }
        }

        impl<T: Real> $operator<f64> for Pair<T> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                Self(self.0.$method(other), self.1.$method(other))
            }
        }
    )*};
}

operator!(Add add, Sub sub, Mul mul, Div div);

impl<T: Real> Neg for Pair<T> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self(-self.0, -self.1)
    }
}

/// Methods that treat both halves alike.
macro_rules! both {
    ($made:ident => $result:ty: $($method:ident($($other:ident: $type:ty),*)),*) => {$(
        #[inline(always)]
        fn $method(self $(, $other: $type)*) -> $result {
            $made(self.0.$method($($other.0),*), self.1.$method($($other.1),*))
        }
    )*};
}

impl<T: Real> Real for Pair<T> {
    type Mask = Masks<T::Mask>;

    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self(self.0.like(value), self.1.like(value))
    }

    both!(Self => Self: sqrt(), abs(), copysign(sign: Self), max(other: Self), min(other: Self));
    both!(Self => Self: clamp(min: Self, max: Self), exp_unless(unwanted: Self::Mask));
    both!(Masks => Self::Mask: eq(other: Self), lt(other: Self), le(other: Self));

    #[inline(always)]
    fn select(mask: Self::Mask, yes: Self, no: Self) -> Self {
        Self(T::select(mask.0, yes.0, no.0), T::select(mask.1, yes.1, no.1))
    }
}
