//! Which messages there are, as data: what each is called, what it holds, whether it is answered.
//!
//! The source gives two names, `TilausAlkaa` and `TilausKuittaus`, and says of the others only that they exist. All other
//! names and the order of their fields are ours; a plant that has its own replaces the table.

use crate::error::{ConfigError, MessageError, Name};
use crate::job::{Bounds, Job, JobKind, Line, Point};
use crate::message::Message;
use crate::role::{Field, Role};
use crate::value::{Charset, Value, Values};

/// The table of messages of one plant.
///
/// ```
/// use kawasaki_msg::{Dialect, Entry, Role};
///
/// // The short name that section 10.2 of the thesis considers: 9 bytes less on the wire.
/// let mut table = Dialect::DEFAULT.entries().to_vec();
/// for entry in table.iter_mut().filter(|entry| entry.role == Role::OrderStart) {
///     entry.name = "TA";
/// }
/// let dialect = Dialect::new(table.leak())?;
/// assert_eq!(dialect.entry(Role::OrderStart).name, "TA");
/// # Ok::<(), kawasaki_msg::ConfigError>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Dialect {
    entries: &'static [Entry],
    charset: Charset,
}

/// One message of the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// What it means to the sessions.
    pub role: Role,
    /// What it is called on the wire.
    pub name: &'static str,
    /// What its fields are, in order.
    pub fields: &'static [Field],
    /// What the other end answers, where an answer is defined (thesis, sections 10.4 and 11.3).
    pub reply: Option<Role>,
    /// Whether it takes effect after the job that is being executed, past the jobs in the queue (thesis, section 11.1).
    pub past_queue: bool,
}

const DEFAULT_TABLE: &[Entry] = {
    use Field::{EndX, EndY, Ended, Executed, Kind, Number, Order, Phase, Queued, StartX, StartY};
    const fn entry(
        role: Role,
        name: &'static str,
        fields: &'static [Field],
        reply: Option<Role>,
        past_queue: bool,
    ) -> Entry {
        Entry { role, name, fields, reply, past_queue }
    }
    const JOB: &[Field] = &[Order, Number, Kind, StartX, StartY, EndX, EndY];
    &[
        entry(Role::Job, "Tyo", JOB, None, false),
        entry(Role::JobAck, "TyoKuittaus", &[Order, Number], None, false),
        entry(Role::JobRequest, "TyoPyynto", &[Order, Number], Some(Role::Job), false),
        entry(Role::Pause, "TyoTauko", &[Order, Queued], None, false),
        entry(Role::OrderStart, "TilausAlkaa", &[Order, Number], Some(Role::OrderAck), false),
        entry(Role::OrderAck, "TilausKuittaus", &[Order], None, false),
        entry(Role::OrderEnd, "TilausLoppuu", &[Order], Some(Role::EndAck), false),
        entry(Role::OrderInterrupt, "TilausKeskeytyy", &[Order], Some(Role::EndAck), true),
        entry(Role::EndAck, "LoppuKuittaus", &[Ended, Order, Executed], None, false),
        entry(Role::Status, "Tila", &[Order, Phase, Queued, Executed, Ended], Some(Role::Status), false),
        entry(Role::Filler, "Huuhaa", &[], None, false),
    ]
};

impl Dialect {
    /// The greatest job number that any table allows: AS has no index of five digits (thesis, section 11.1.1).
    pub const MAX_NUMBER: u16 = 9999;

    /// The source's two names, and ours for the rest. See the table in the crate's README.
    pub const DEFAULT: Self = Self { entries: DEFAULT_TABLE, charset: Charset::Ascii };

    /// A table of the caller's, in ASCII.
    ///
    /// # Errors
    /// When a role of the default table is missing or occurs twice, a name occurs twice, or a message lacks a field that the
    /// default table gives it.
    pub fn new(entries: &'static [Entry]) -> Result<Self, ConfigError> {
        for needed in DEFAULT_TABLE {
            let mut found = entries.iter().filter(|entry| entry.role == needed.role);
            let (Some(entry), None) = (found.next(), found.next()) else {
                return Err(ConfigError::Role { role: needed.role });
            };
            let complete = needed.fields.iter().all(|field| entry.fields.contains(field));
            if !complete || entry.fields.len() > Params::MAX_FIELDS {
                return Err(ConfigError::Fields { role: needed.role });
            }
        }
        for (i, entry) in entries.iter().enumerate() {
            let again = entries.iter().skip(i + 1).any(|other| other.name == entry.name);
            if again || entry.name.is_empty() {
                return Err(ConfigError::Name { role: entry.role });
            }
        }
        Ok(Self { entries, charset: Charset::Ascii })
    }

    /// The same table in another character set.
    #[must_use]
    pub const fn with_charset(mut self, charset: Charset) -> Self {
        self.charset = charset;
        self
    }

    /// Whether both ends can agree on this highest job number.
    pub(crate) fn check_max_number(found: u16) -> Result<(), ConfigError> {
        let is_valid = (2..=Self::MAX_NUMBER).contains(&found);
        if is_valid { Ok(()) } else { Err(ConfigError::MaxNumber { found }) }
    }

    /// The character set of names and fields.
    pub const fn charset(&self) -> Charset {
        self.charset
    }

    /// All messages of the table.
    pub const fn entries(&self) -> &'static [Entry] {
        self.entries
    }

    /// The message with this role. For a [`Role::Command`] that the table does not have, the filler.
    pub fn entry(&self, role: Role) -> &'static Entry {
        let entry = self.entries.iter().find(|entry| entry.role == role);
        entry.or_else(|| self.entries.iter().find(|e| e.role == Role::Filler)).unwrap_or(&FILLER)
    }

    /// The message with this name.
    pub fn find(&self, name: Value<'_>) -> Option<&'static Entry> {
        self.entries.iter().find(|entry| name == *entry.name)
    }

    /// What a message means, with its values; the number of fields and each value are checked.
    ///
    /// # Errors
    /// See [`MessageError`].
    pub fn read(&self, message: &Message<'_>) -> Result<(Role, Params), MessageError> {
        let unknown = || MessageError::UnknownName { name: Name::new(message.name.chars()) };
        let entry = self.find(message.name).ok_or_else(unknown)?;
        let mut params = Params::default();
        let mut values = message.fields.iter();
        for (index, field) in entry.fields.iter().enumerate() {
            let Some(value) = values.next() else {
                // A single empty value is no value on the wire.
                if field.may_be_empty() && entry.fields.len() == 1 {
                    break;
                }
                return Err(MessageError::FieldCount { expected: entry.fields.len(), found: index });
            };
            if *field == Field::Unused || field.may_be_empty() && value.is_empty() {
                continue;
            }
            let found = value.number().ok_or(MessageError::NotANumber { field: index })?;
            let (min, max) = field.range();
            if !(min..=max).contains(&found) {
                return Err(MessageError::OutOfRange { field: index, found, min, max });
            }
            params.set(*field, found);
        }
        if values.next().is_some() {
            let (expected, found) = (entry.fields.len(), message.fields.count());
            return Err(MessageError::FieldCount { expected, found });
        }
        Ok((entry.role, params))
    }

    /// Gives the message with this role and these values to `f`. A value that is not there is written empty.
    pub fn write<T>(&self, role: Role, params: &Params, f: impl FnOnce(&Message<'_>) -> T) -> T {
        let entry = self.entry(role);
        let mut values = [Value::Text(""); Params::MAX_FIELDS];
        for (value, field) in values.iter_mut().zip(entry.fields) {
            *value = params.get(*field).map_or(Value::Text(""), Value::Number);
        }
        let fields = values.get(..entry.fields.len()).unwrap_or_default();
        f(&Message { name: Value::Text(entry.name), header: Values::NONE, fields: Values::List(fields) })
    }
}

impl Default for Dialect {
    fn default() -> Self {
        Self::DEFAULT
    }
}

const FILLER: Entry =
    Entry { role: Role::Filler, name: "Huuhaa", fields: &[], reply: None, past_queue: false };

/// The values of a message by what they are, in whatever order the table puts them.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Params {
    values: [Option<i32>; Field::COUNT],
}

impl Params {
    /// The most fields that a message of a table can have.
    pub const MAX_FIELDS: usize = 16;

    /// The value of a field; `None` when the message has none or has it empty.
    pub fn get(&self, field: Field) -> Option<i32> {
        self.values.get(field as usize).copied().flatten()
    }

    /// Sets the value of a field.
    pub fn set(&mut self, field: Field, value: i32) {
        if let Some(place) = self.values.get_mut(field as usize) {
            *place = Some(value);
        }
    }

    /// These values and one more.
    #[must_use]
    pub fn with(mut self, field: Field, value: impl Into<Option<u16>>) -> Self {
        if let Some(value) = value.into() {
            self.set(field, i32::from(value));
        }
        self
    }

    /// The value of a field that counts something; `None` also when it is no `u16`.
    pub fn number(&self, field: Field) -> Option<u16> {
        self.get(field).and_then(|value| u16::try_from(value).ok())
    }

    /// The values of a job of an order.
    pub fn from_job(order: u16, Job { number, line }: Job) -> Self {
        let mut params = Self::default().with(Field::Order, order).with(Field::Number, number);
        params.set(Field::Kind, line.kind.code());
        params.set(Field::StartX, line.start.x);
        params.set(Field::StartY, line.start.y);
        params.set(Field::EndX, line.end.x);
        params.set(Field::EndY, line.end.y);
        params
    }

    /// The job in these values, its coordinates checked (thesis, section 7.3).
    ///
    /// # Errors
    /// The first value that is missing or out of range, with its place in the dialect's message.
    pub fn job(&self, dialect: &Dialect, bounds: &Bounds) -> Result<Job, MessageError> {
        let at = |field| dialect.entry(Role::Job).fields.iter().position(|f| *f == field).unwrap_or(0);
        let missing = |field| MessageError::NotANumber { field: at(field) };
        let coordinate = |field: Field, min: i32, max: i32| match self.get(field) {
            Some(found) if (min..=max).contains(&found) => Ok(found),
            Some(found) => Err(MessageError::OutOfRange { field: at(field), found, min, max }),
            None => Err(missing(field)),
        };
        let point = |x, y| {
            let x = coordinate(x, bounds.min.x, bounds.max.x)?;
            Ok(Point { x, y: coordinate(y, bounds.min.y, bounds.max.y)? })
        };
        let number = self.number(Field::Number).ok_or(missing(Field::Number))?;
        let kind = self.get(Field::Kind).and_then(JobKind::from_code).ok_or(missing(Field::Kind))?;
        let (start, end) = (point(Field::StartX, Field::StartY)?, point(Field::EndX, Field::EndY)?);
        Ok(Job { number, line: Line { kind, start, end } })
    }
}
