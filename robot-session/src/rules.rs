//! The rules of a machine, for a model that shows the need for each.

use core::fmt;
use core::marker::PhantomData;

/// The rules of a machine, by name. [`rules!`](crate::rules) implements it.
pub trait Rule: Copy + PartialEq + fmt::Debug + 'static {
    /// All rules of the machine.
    const ALL: &'static [Self];
}

/// The rules that a machine follows: all of them. With the feature `model` one or two can be left out, and the type has a
/// size.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
pub struct Rules<R> {
    #[cfg(feature = "model")]
    without: [Option<R>; 2],
    rules: PhantomData<R>,
}

impl<R> Rules<R> {
    /// The machine follows every rule.
    pub const ALL: Self = Self {
        #[cfg(feature = "model")]
        without: [None, None],
        rules: PhantomData,
    };
}

#[cfg(feature = "model")]
impl<R: Rule> Rules<R> {
    /// Returns every rule except `rule`.
    pub const fn without(rule: R) -> Self {
        Self { without: [Some(rule), None], rules: PhantomData }
    }

    /// Returns every rule except `first` and `second`.
    pub const fn without_both(first: R, second: R) -> Self {
        Self { without: [Some(first), Some(second)], rules: PhantomData }
    }

    /// Returns whether the machine follows a rule.
    #[inline]
    pub fn keeps(&self, rule: R) -> bool {
        !self.without.contains(&Some(rule))
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

/// Defines the enum of a machine's rules, and their part of its configuration. With the crate's feature `model` the
/// configuration has a field `rules`; without it every rule is followed.
#[macro_export]
macro_rules! rules {
    ($(#[$about:meta])* pub enum $name:ident $(for $($config:ty),+)? { $($(#[$doc:meta])* $rule:ident,)* }) => {
        $(#[$about])*
        #[doc(hidden)]
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
        pub enum $name { $($(#[$doc])* $rule,)* }

        impl $crate::end::Rule for $name {
            const ALL: &'static [Self] = &[$(Self::$rule),*];
        }

        $($(impl $config {
            /// Returns whether the machine applies a rule.
            #[cfg(feature = "model")]
            #[inline]
            #[allow(dead_code, reason = "of two configurations one may only be made of the other")]
            pub(crate) fn keeps(&self, rule: $name) -> bool {
                self.rules.keeps(rule)
            }

            /// Returns true: the machine applies every rule.
            #[cfg(not(feature = "model"))]
            #[inline(always)]
            #[allow(dead_code, reason = "of two configurations one may only be made of the other")]
            pub(crate) const fn keeps(&self, _rule: $name) -> bool {
                true
            }

            /// Returns the configuration with these rules, for the model.
            #[cfg(feature = "model")]
            #[doc(hidden)]
            #[must_use]
            pub fn with_rules(mut self, rules: $crate::end::Rules<$name>) -> Self {
                self.rules = rules;
                self
            }

            /// Returns the configuration unchanged: it has no other rules.
            #[cfg(not(feature = "model"))]
            #[doc(hidden)]
            #[must_use]
            pub fn with_rules(self, _rules: $crate::end::Rules<$name>) -> Self {
                self
            }
        })+)?
    };
}
