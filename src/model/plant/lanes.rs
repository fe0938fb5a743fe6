//! Several numbers in the lanes of one register or two; the processor's registers are detected at run time.
//!
//! Sixteen lanes with AVX-512, eight with AVX2, four with NEON, two elsewhere. Of crates that know instruction sets at run time, `pulp` gives
//! typed registers without unsafe code in what uses it.

mod pair;

use std::fmt;
use std::ops::{Add, BitAnd, BitOr, Div, Mul, Neg, Sub};

use pulp::{Arch, Simd, WithSimd, bytemuck};

use crate::plant::real::{Real, Truth};
use pair::Pair;

/// Most lanes of any width.
pub(crate) const MOST_LANES: usize = 16;

/// The bit of a number that is its sign, and those that are its size. `pulp`'s own `neg_f64s`, `abs_f64s` and `select_f64s` may be calls out
/// of the function that is compiled for wide registers.
const SIGN: f64 = -0.0;
const SIZE: f64 = f64::from_bits(!SIGN.to_bits());

/// Numbers side by side, each of which can be looked at.
pub trait Wide: Real {
    /// How many.
    const COUNT: usize;
    /// One of them.
    fn lane(self, lane: usize) -> f64;
    /// As many new ones.
    #[must_use]
    fn each(self, of: impl FnMut(usize) -> f64) -> Self;
}

/// Work that can be done in lanes of any width.
pub trait LaneWork {
    /// Its result.
    type Output;
    /// Runs it; `zero` has the width, and all constants are made like it.
    fn run<T: Wide>(self, zero: T) -> Self::Output;
}

/// A number of lanes that this processor has registers for: one register, or two.
#[derive(Clone, Copy, Debug)]
pub struct Width {
    arch: Arch,
    pair: bool,
}

impl Width {
    /// All that are worth their while, the narrowest first.
    pub fn all() -> Vec<Self> {
        #[cfg(target_arch = "x86_64")]
        {
            use pulp::x86::{V3, V4};
            // Two registers of AVX2 are faster than one of AVX-512: nothing waits for its quotients.
            let avx2 = V3::try_new().map(Arch::V3).into_iter();
            let avx2 = avx2.flat_map(|arch| [Self { arch, pair: false }, Self { arch, pair: true }]);
            let avx512 = V4::try_new().map(|simd| Self { arch: Arch::V4(simd), pair: true });
            std::iter::once(Self { arch: Arch::Scalar, pair: true }).chain(avx2).chain(avx512).collect()
        }
        #[cfg(not(target_arch = "x86_64"))]
        {
            let widths = [false, true].map(|pair| Self { arch: Arch::new(), pair });
            widths.into_iter().filter(|width| width.lanes() > 1).collect()
        }
    }

    /// The most lanes that a batch may have.
    pub fn most_lanes() -> usize {
        Self::all().last().map_or(1, |widest| widest.lanes())
    }

    /// The narrowest with so many lanes; none where no register has as many.
    pub fn holding(count: usize) -> Option<Self> {
        Self::all().into_iter().find(|width| width.lanes() >= count)
    }

    /// Its number of lanes.
    pub fn lanes(self) -> usize {
        struct Count;
        impl LaneWork for Count {
            type Output = usize;

            #[inline(always)]
            fn run<T: Wide>(self, _zero: T) -> usize {
                T::COUNT
            }
        }
        self.run(Count)
    }

    /// Does a job compiled for this width.
    pub fn run<J: LaneWork>(self, job: J) -> J::Output {
        if self.pair { self.arch.dispatch(Double(job)) } else { self.arch.dispatch(SingleRegister(job)) }
    }
}

/// A job in one register.
struct SingleRegister<J>(J);

impl<J: LaneWork> WithSimd for SingleRegister<J> {
    type Output = J::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> J::Output {
        self.0.run(Lanes { simd, values: simd.splat_f64s(0.0) })
    }
}

/// A job in two registers.
struct Double<J>(J);

impl<J: LaneWork> WithSimd for Double<J> {
    type Output = J::Output;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> J::Output {
        let zero = Lanes { simd, values: simd.splat_f64s(0.0) };
        self.0.run(Pair(zero, zero))
    }
}

/// Numbers in the lanes of one register, with the right to use its instructions.
#[derive(Clone, Copy)]
struct Lanes<S: Simd> {
    simd: S,
    values: S::f64s,
}

impl<S: Simd> Lanes<S> {
    #[inline(always)]
    fn with(self, values: S::f64s) -> Self {
        Self { values, ..self }
    }
}

impl<S: Simd> fmt::Debug for Lanes<S> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.values.fmt(f)
    }
}

impl<S: Simd> Wide for Lanes<S> {
    const COUNT: usize = S::F64_LANES;

    #[inline(always)]
    fn lane(self, lane: usize) -> f64 {
        bytemuck::cast_slice(std::slice::from_ref(&self.values))[lane]
    }

    #[inline(always)]
    fn each(mut self, mut of: impl FnMut(usize) -> f64) -> Self {
        let values: &mut [f64] = bytemuck::cast_slice_mut(std::slice::from_mut(&mut self.values));
        for (lane, value) in values.iter_mut().enumerate() {
            *value = of(lane);
        }
        self
    }
}

/// Truth values in lanes.
#[derive(Clone, Copy, Debug)]
pub struct Mask<S: Simd> {
    simd: S,
    values: S::m64s,
}

impl<S: Simd> Mask<S> {
    /// Whether it holds anywhere, and whether it holds everywhere.
    #[inline(always)]
    fn any_and_all(self) -> (bool, bool) {
        if const { size_of::<S::m64s>() == 1 } {
            let bits: u8 = bytemuck::cast(self.values);
            (bits != 0, u32::from(bits) == (1 << S::F64_LANES) - 1)
        } else {
            let wide: S::u64s = bytemuck::cast(self.values);
            let words: &[u64] = bytemuck::cast_slice(std::slice::from_ref(&wide));
            (words.iter().fold(0, |sum, word| sum | word) != 0, words.iter().fold(!0, |sum, word| sum & word) == !0)
        }
    }
}

impl<S: Simd> Truth<Lanes<S>> for Mask<S> {
    #[inline(always)]
    fn any(self) -> bool {
        self.any_and_all().0
    }

    #[inline(always)]
    fn all(self) -> bool {
        self.any_and_all().1
    }
}

impl<S: Simd> BitAnd for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitand(self, other: Self) -> Self {
        Self { values: self.simd.and_m64s(self.values, other.values), ..self }
    }
}

impl<S: Simd> BitOr for Mask<S> {
    type Output = Self;

    #[inline(always)]
    fn bitor(self, other: Self) -> Self {
        Self { values: self.simd.or_m64s(self.values, other.values), ..self }
    }
}

/// An operator of lanes, by lanes and by one number.
macro_rules! operator {
    ($($operator:ident $method:ident $simd:ident),*) => {$(
        impl<S: Simd> $operator for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: Self) -> Self {
                self.with(self.simd.$simd(self.values, other.values))
            }
        }

        impl<S: Simd> $operator<f64> for Lanes<S> {
            type Output = Self;

            #[inline(always)]
            fn $method(self, other: f64) -> Self {
                self.with(self.simd.$simd(self.values, self.simd.splat_f64s(other)))
            }
        }
    )*};
}

operator!(Add add add_f64s, Sub sub sub_f64s, Mul mul mul_f64s, Div div div_f64s);

impl<S: Simd> Neg for Lanes<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        self.with(self.simd.xor_f64s(self.values, self.simd.splat_f64s(SIGN)))
    }
}

impl<S: Simd> Real for Lanes<S> {
    type Mask = Mask<S>;

    #[inline(always)]
    fn like(self, value: f64) -> Self {
        self.with(self.simd.splat_f64s(value))
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        self.with(self.simd.sqrt_f64s(self.values))
    }

    #[inline(always)]
    fn abs(self) -> Self {
        self.with(self.simd.and_f64s(self.values, self.simd.splat_f64s(SIZE)))
    }

    #[inline(always)]
    fn copysign(self, sign: Self) -> Self {
        let simd = self.simd;
        let (sign, size) = (simd.and_f64s(sign.values, simd.splat_f64s(SIGN)), self.abs().values);
        self.with(simd.or_f64s(size, sign))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.with(self.simd.max_f64s(self.values, other.values))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        self.with(self.simd.min_f64s(self.values, other.values))
    }

    #[inline(always)]
    fn clamp(self, min: Self, max: Self) -> Self {
        if S::IS_SCALAR {
            // Its `min` and `max` would make a number of what is none.
            return Self::select(self.lt(min), min, Self::select(max.lt(self), max, self));
        }
        max.min(min.max(self))
    }

    #[inline(always)]
    fn exp_unless(self, unwanted: Mask<S>) -> Self {
        let power = Self::select(unwanted, self.like(0.0), self);
        self.each(|lane| if power.lane(lane) == 0.0 { 1.0 } else { power.lane(lane).exp() })
    }

    #[inline(always)]
    fn eq(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, values: self.simd.equal_f64s(self.values, other.values) }
    }

    #[inline(always)]
    fn lt(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, values: self.simd.less_than_f64s(self.values, other.values) }
    }

    #[inline(always)]
    fn le(self, other: Self) -> Mask<S> {
        Mask { simd: self.simd, values: self.simd.less_than_or_equal_f64s(self.values, other.values) }
    }

    #[inline(always)]
    fn select(mask: Mask<S>, yes: Self, no: Self) -> Self {
        let chosen = yes.simd.select_u64s(mask.values, pulp::cast(yes.values), pulp::cast(no.values));
        yes.with(pulp::cast(chosen))
    }
}

/// Makes lanes of one number of each unit.
pub type SideBySide<'a, T> = dyn Fn(&dyn Fn(usize) -> f64) -> T + 'a;

/// A law whose quantities can stand side by side for several units.
pub(crate) trait Abreast<T> {
    /// The law with lanes for numbers.
    type Lanes;
    /// The quantities of all units; `of` names a unit.
    fn abreast<'a>(of: &dyn Fn(usize) -> &'a Self, side_by_side: &SideBySide<'_, T>) -> Self::Lanes
    where
        Self: 'a;
}

impl<T> Abreast<T> for f64 {
    type Lanes = T;

    fn abreast<'a>(of: &dyn Fn(usize) -> &'a f64, side_by_side: &SideBySide<'_, T>) -> T
    where
        Self: 'a,
    {
        side_by_side(&|unit| *of(unit))
    }
}

impl<T, A: Abreast<T>> Abreast<T> for [A; 2] {
    type Lanes = [A::Lanes; 2];

    fn abreast<'a>(of: &dyn Fn(usize) -> &'a Self, side_by_side: &SideBySide<'_, T>) -> [A::Lanes; 2]
    where
        Self: 'a,
    {
        std::array::from_fn(|k| A::abreast(&|unit| &of(unit)[k], side_by_side))
    }
}

/// A law of these quantities, with its lanes.
macro_rules! abreast {
    ($(#[$about:meta])* $seen:vis struct $law:ident<T = f64> {
        $($(#[$doc:meta])* $open:vis $quantity:ident: $type:ty,)*
    }) => {
        $(#[$about])*
        $seen struct $law<T = f64> {
            $($(#[$doc])* $open $quantity: $type,)*
        }

        impl<T> $crate::plant::lanes::Abreast<T> for $law {
            type Lanes = $law<T>;

            fn abreast<'a>(
                of: &dyn Fn(usize) -> &'a Self,
                side_by_side: &$crate::plant::lanes::SideBySide<'_, T>,
            ) -> $law<T>
            where
                Self: 'a,
            {
                $law { $($quantity: $crate::plant::lanes::Abreast::abreast(&|unit| &of(unit).$quantity, side_by_side)),* }
            }
        }
    };
}

/// The same, and access to one lane.
macro_rules! apart {
    ($(#[$about:meta])* $seen:vis struct $law:ident<T = f64> {
        $($(#[$doc:meta])* $open:vis $quantity:ident: T,)*
    }) => {
        $crate::plant::lanes::abreast! {
            $(#[$about])*
            $seen struct $law<T = f64> {
                $($(#[$doc])* $open $quantity: T,)*
            }
        }

        impl<T: $crate::plant::lanes::Wide> $law<T> {
            /// The quantities in one lane.
            #[inline(always)]
            pub(crate) fn lane(&self, lane: usize) -> $law {
                $law { $($quantity: self.$quantity.lane(lane)),* }
            }
        }
    };
}

pub(crate) use {abreast, apart};
