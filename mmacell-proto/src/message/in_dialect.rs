/// A message as a dialect writes it, see [`Command::in_dialect`](crate::Command::in_dialect) and
/// [`Reply::in_dialect`](crate::Reply::in_dialect).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InDialect<M> {
    pub(super) message: M,
    pub(super) dialect: crate::dialect::Dialect,
}
