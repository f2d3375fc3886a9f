use core::fmt;
use core::ops::RangeInclusive;

use crate::error::{FieldError, FieldFault};
use crate::text::{Name, Text};

/// The job type of an application. It names its fields once, and they are read, written, checked and listed from that one
/// place.
///
/// ```
/// use kawasaki_msg::{FieldVisitor, VisitResult, Text, Work};
///
/// /// Move a pallet: where to, with which tool, how fast.
/// #[derive(Clone, Copy, Default)]
/// struct PalletMove {
///     joints: [i32; 6], // thousandths of a degree
///     tool: Text<8>,
///     speed: u8, // per cent
/// }
///
/// impl Work for PalletMove {
///     type Ranges = ();
///
///     fn fields<F: FieldVisitor>(&mut self, (): &(), fields: &mut F) -> VisitResult {
///         for (joint, name) in self.joints.iter_mut().zip(["j1", "j2", "j3", "j4", "j5", "j6"]) {
///             fields.decimal(name, joint, 3, -360_000..=360_000)?;
///         }
///         fields.text("tool", &mut self.tool, 1..=8)?;
///         fields.whole("speed", &mut self.speed, 1..=100)
///     }
/// }
/// ```
pub trait Work: Copy + Default {
    /// The parts of the fields' ranges that are known only at run time; `()` if all ranges are constant.
    type Ranges: Clone + Default + fmt::Debug;

    /// Visits every field in the order of the wire. The fields after a value may depend on it: jobs of different kinds may
    /// have different fields.
    ///
    /// # Errors
    /// The error of a visit, returned at once.
    fn fields<F: FieldVisitor>(&mut self, ranges: &Self::Ranges, fields: &mut F) -> VisitResult;
}

/// The result of a visit: whether the field fits.
pub type VisitResult = Result<(), Unfit>;

/// A visitor of the fields of a [`Work`]: it reads each field from a message, writes it into one, or lists it. The ranges
/// include both ends and are checked in both directions.
pub trait FieldVisitor {
    /// Visits a number with up to `places` decimals, 0 to 9, in whole units of the last decimal: 1500 with 3 places is `1.5`.
    ///
    /// Written with exactly this many decimals, `1.500`, and without a point if `places` is 0. Other forms can be read:
    /// `1.5`, `1.50`, `1.5000`, `-.5`, `2.`, `2`, with zeros and blanks before the number and blanks after it. Errors are
    /// `1e3`, `+1`, and a digit other than 0 after the last place: nothing is rounded. If `places` is 0, any point is an
    /// error too.
    ///
    /// # Errors
    /// If the field is missing or does not fit.
    fn decimal(&mut self, name: &str, value: &mut i32, places: u8, range: RangeInclusive<i32>)
    -> VisitResult;

    /// Visits a text of this many characters, which is not changed; blanks are part of it. The four marks and characters
    /// outside the dialect's character set are not allowed.
    ///
    /// # Errors
    /// If the field is missing or does not fit.
    fn text<const N: usize>(
        &mut self,
        name: &str,
        text: &mut Text<N>,
        length: RangeInclusive<usize>,
    ) -> VisitResult;

    /// Refuses a field for a reason that the caller has found.
    fn refuse(&mut self, error: FieldError) -> Unfit;

    /// Visits a whole number, or an enum with a code: any type that is an `i32` on the wire.
    ///
    /// # Errors
    /// If the field is missing or does not fit.
    #[inline(always)]
    fn whole<T: Copy + Into<i32> + TryFrom<i32>>(
        &mut self,
        name: &str,
        value: &mut T,
        range: RangeInclusive<T>,
    ) -> VisitResult {
        let (min, max) = range.into_inner();
        let mut number = (*value).into();
        self.decimal(name, &mut number, 0, min.into()..=max.into())?;
        match T::try_from(number) {
            Ok(number) => *value = number,
            Err(_) => return Err(self.refuse(no_value(name, number))),
        }
        Ok(())
    }
}

#[cold]
fn no_value(name: &str, found: i32) -> FieldError {
    FieldError { field: Name::of(name), fault: FieldFault::Value { found } }
}

/// The error of a field that does not fit: the visitor has its name and the reason. Made by [`FieldVisitor::refuse`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a field of the job does not fit")]
pub struct Unfit(pub(crate) ());
