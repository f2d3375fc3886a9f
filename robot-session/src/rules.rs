//! The rules of a machine, for a model that shows what each is for.

use core::fmt;
use core::marker::PhantomData;

/// The rules of a machine, by name. [`rules!`](crate::rules) implements it.
pub trait Rule: Copy + PartialEq + fmt::Debug + 'static {
    /// All of them.
    const ALL: &'static [Self];
}

/// Which rules a machine keeps: all of them. With the feature `model` one or two can be left out, and this has a size.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Rules<R> {
    #[cfg(feature = "model")]
    without: [Option<R>; 2],
    rules: PhantomData<R>,
}

impl<R> Rules<R> {
    /// Every rule is kept.
    pub const ALL: Self = Self {
        #[cfg(feature = "model")]
        without: [None, None],
        rules: PhantomData,
    };
}

impl<R: Rule> Rules<R> {
    /// Every rule but one.
    #[cfg(feature = "model")]
    pub const fn without(rule: R) -> Self {
        Self { without: [Some(rule), None], rules: PhantomData }
    }

    /// Every rule but two.
    #[cfg(feature = "model")]
    pub const fn without_both(first: R, second: R) -> Self {
        Self { without: [Some(first), Some(second)], rules: PhantomData }
    }

    /// Whether the machine keeps a rule.
    #[cfg(feature = "model")]
    #[inline]
    pub fn keeps(&self, rule: R) -> bool {
        !self.without.contains(&Some(rule))
    }

    /// Whether the machine keeps a rule: without the feature `model` it always does.
    #[cfg(not(feature = "model"))]
    #[inline(always)]
    pub const fn keeps(&self, _rule: R) -> bool {
        true
    }
}

impl<R> Default for Rules<R> {
    fn default() -> Self {
        Self::ALL
    }
}

impl<R: fmt::Debug> fmt::Debug for Rules<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        #[cfg(feature = "model")]
        match &self.without {
            [Some(rule), None] => return write!(f, "All but {rule:?}"),
            [Some(first), Some(second)] => return write!(f, "All but {first:?} and {second:?}"),
            [None, _] => {}
        }
        f.write_str("All")
    }
}

/// Defines the enum of a machine's rules.
#[macro_export]
macro_rules! rules {
    ($(#[$about:meta])* pub enum $name:ident { $($(#[$doc:meta])* $rule:ident,)* }) => {
        $(#[$about])*
        #[doc(hidden)]
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $name { $($(#[$doc])* $rule,)* }

        impl $crate::Rule for $name {
            const ALL: &'static [Self] = &[$(Self::$rule),*];
        }
    };
}
