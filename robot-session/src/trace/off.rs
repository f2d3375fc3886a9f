//! The functions without the feature, which do nothing.

#[cfg(feature = "tokio")]
use core::future::Future;

#[inline(always)]
pub(crate) const fn connected() {}

#[inline(always)]
pub(crate) const fn disconnected() {}

#[inline(always)]
pub(crate) const fn received(_bytes: &[u8]) {}

#[inline(always)]
pub(crate) const fn written(_bytes: &[u8]) {}

#[inline(always)]
pub(crate) const fn event<E>(_event: &E) {}

#[cfg(feature = "tokio")]
pub(crate) const fn failed<R>(_what: &str, _reason: &R) {}

#[cfg(feature = "std")]
#[derive(Debug, Clone)]
pub(crate) struct Span;

#[cfg(feature = "std")]
impl Span {
    pub(crate) const fn of(_of: [&str; 2], _peer: Option<&str>) -> Self {
        Self
    }

    #[inline(always)]
    pub(crate) fn within<T>(&self, work: impl FnOnce() -> T) -> T {
        work()
    }

    #[cfg(feature = "tokio")]
    pub(crate) const fn instrument<F: Future>(&self, future: F) -> F {
        future
    }
}

#[cfg(feature = "tokio")]
#[derive(Clone)]
pub(crate) struct Call;

#[cfg(feature = "tokio")]
impl Call {
    #[inline(always)]
    pub(crate) const fn of(_of: [&str; 2]) -> Self {
        Self
    }

    #[inline(always)]
    pub(crate) const fn begun<C>(&self, _call: &C) {}

    #[inline(always)]
    pub(crate) const fn ended<O>(&self, _outcome: &O) {}
}
