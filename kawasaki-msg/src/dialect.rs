//! The messages of a plant as data: their names and fields.
//!
//! The source gives two names, `TilausAlkaa` and `TilausKuittaus`, and mentions the others only as existing. All other names
//! and the order of their fields are this project's; a plant with its own names replaces the table.

use crate::error::{ConfigError, EncodeError, MessageError};
use crate::job::{self, Job, Work};
use crate::message::Message;
use crate::params::{Params, ValueFault};
use crate::role::{Field, Role};
use crate::text::Name;
use crate::value::{Charset, Value, Values};
use crate::writer::Writer;

/// The table of messages of one plant. A table that is read from a file is leaked, since it lasts as long as the program.
///
/// ```
/// use kawasaki_msg::{Dialect, Role};
///
/// // The short name that section 10.2 of the thesis considers: 9 bytes less on the wire.
/// let name = String::from("TA").leak();
/// let mut table = Dialect::DEFAULT.entries().to_vec();
/// for entry in table.iter_mut().filter(|entry| entry.role == Role::OrderStart) {
///     entry.name = name;
/// }
/// let dialect = Dialect::new(table.leak())?;
/// assert_eq!(dialect.entry(Role::OrderStart).unwrap().name, "TA");
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
    /// The meaning of the message for the sessions.
    pub role: Role,
    /// The name of the message on the wire.
    pub name: &'static str,
    /// The values between the name and the length, in sequence. Empty: none are written, and values that are read there are
    /// not checked.
    pub header: &'static [Field],
    /// The fields of the message, in sequence.
    pub fields: &'static [Field],
}

const DEFAULT_TABLE: &[Entry] = {
    use Field::{Ended, Executed, Number, Order, Phase, Queued, Work};
    const fn entry(role: Role, name: &'static str, fields: &'static [Field]) -> Entry {
        Entry { role, name, header: &[], fields }
    }
    &[
        entry(Role::Job, "Tyo", &[Order, Number, Work]),
        entry(Role::JobAck, "TyoKuittaus", &[Order, Number]),
        entry(Role::JobRequest, "TyoPyynto", &[Order, Number]),
        entry(Role::Pause, "TyoTauko", &[Order, Queued]),
        entry(Role::OrderStart, "TilausAlkaa", &[Order, Number]),
        entry(Role::OrderAck, "TilausKuittaus", &[Order]),
        entry(Role::OrderEnd, "TilausLoppuu", &[Order]),
        entry(Role::OrderInterrupt, "TilausKeskeytyy", &[Order]),
        entry(Role::EndAck, "LoppuKuittaus", &[Ended, Order, Executed]),
        entry(Role::Status, "Tila", &[Order, Phase, Queued, Executed, Ended]),
        entry(Role::Filler, "Huuhaa", &[]),
    ]
};

/// Returns whether a table may lack a message (`None`) or a field of it, for a guarantee (specification, KM-28).
fn is_optional(role: Role, field: Option<Field>) -> bool {
    use Field::{Ended, Number, Order, Phase, Queued};
    use Role::{EndAck, Job, JobAck, JobRequest, OrderEnd, OrderInterrupt, OrderStart, Pause, Status};
    match field {
        None => matches!(role, JobAck | Pause | OrderInterrupt),
        Some(Order) => {
            matches!(role, Job | JobAck | JobRequest | Pause | OrderEnd | OrderInterrupt | EndAck)
        }
        Some(Number) => role == OrderStart,
        Some(Queued) => role == Pause,
        Some(Phase | Ended) => role == Status,
        Some(_) => false,
    }
}

impl Dialect {
    /// The greatest job number that any table allows: AS has no index of five digits (thesis, section 11.1.1).
    pub const MAX_NUMBER: u16 = 9999;

    /// The maximum number of fields of a message of a table; all of a job's own fields count as one.
    pub const MAX_FIELDS: usize = 16;

    /// The source's two names, and this project's for the rest (specification, KM-18).
    pub const DEFAULT: Self = Self { entries: DEFAULT_TABLE, charset: Charset::Ascii };

    /// Creates a table of the caller, in ASCII. The table may lack some roles and fields (specification, KM-28).
    ///
    /// # Errors
    /// If a role that every session needs is missing or any occurs twice, a name is empty or occurs twice, a message lacks
    /// a field that every session needs, has one twice, has one without a meaning in it, or has more than 16.
    pub fn new(entries: &'static [Entry]) -> Result<Self, ConfigError> {
        let count = |role| entries.iter().filter(|entry| entry.role == role).count();
        for needed in DEFAULT_TABLE {
            let is_missing = count(needed.role) == 0 && !is_optional(needed.role, None);
            if is_missing {
                return Err(ConfigError::Role { role: needed.role });
            }
        }
        for (i, entry) in entries.iter().enumerate() {
            let role = entry.role;
            if count(role) > 1 {
                return Err(ConfigError::Role { role });
            }
            entry.check()?;
            let again = entries.iter().skip(i + 1).any(|other| other.name == entry.name);
            if again || entry.name.is_empty() {
                return Err(ConfigError::Name { role });
            }
        }
        Ok(Self { entries, charset: Charset::Ascii })
    }

    /// Returns the table in another character set.
    #[must_use]
    pub const fn with_charset(mut self, charset: Charset) -> Self {
        self.charset = charset;
        self
    }

    /// Checks that a session can number its jobs up to this one, has these roles, and can determine the order of late
    /// messages.
    pub(crate) fn check(
        &self,
        max_number: u16,
        datagrams: bool,
        roles: [Option<Role>; 2],
    ) -> Result<(), ConfigError> {
        if !(2..=Self::MAX_NUMBER).contains(&max_number) {
            return Err(ConfigError::MaxNumber { found: max_number });
        }
        if let Some(role) = roles.into_iter().flatten().find(|role| self.entry(*role).is_none()) {
            return Err(ConfigError::Lacks { role });
        }
        // An acknowledged end names its order as the ended one.
        let late = |entry: &&Entry| {
            let names = |field| entry.all().any(|other| *other == field);
            is_optional(entry.role, Some(Field::Order)) && !names(Field::Order) && !names(Field::Ended)
        };
        match self.entries.iter().find(late) {
            Some(entry) if datagrams => Err(ConfigError::LateMessages { role: entry.role }),
            _ => Ok(()),
        }
    }

    /// Returns the character set of names and fields.
    pub const fn charset(&self) -> Charset {
        self.charset
    }

    /// Returns all messages of the table.
    pub const fn entries(&self) -> &'static [Entry] {
        self.entries
    }

    /// Returns the message with this role.
    pub fn entry(&self, role: Role) -> Option<&'static Entry> {
        self.entries.iter().find(|entry| entry.role == role)
    }

    /// Returns the message with this name.
    #[inline(always)]
    fn find(&self, name: Value<'_>) -> Option<&'static Entry> {
        // A letter above 127 is one byte on the wire and two in the table.
        let is_ascii = self.charset == Charset::Ascii || name.as_bytes().is_ascii();
        self.entries.iter().find(|entry| match is_ascii {
            // Most names are short: a loop is less than a call.
            true => name.as_bytes().iter().eq(entry.name.as_bytes()),
            false => name == *entry.name,
        })
    }

    /// Returns the meaning of a message, and its values. The number of fields and each value are checked, but not a job's own
    /// fields: see [`read_job`](Self::read_job).
    ///
    /// # Errors
    /// See [`MessageError`].
    pub fn read(&self, message: &Message<'_>) -> Result<(Role, Params), MessageError> {
        let mut params = Params::default();
        let (entry, _) = self.read_values(message, &mut params)?;
        Ok((entry.role, params))
    }

    /// Returns the job in a message; its order is 0 if the table's jobs do not name it.
    ///
    /// # Errors
    /// If the message is not a job, or the first value of it that does not fit.
    pub fn read_job<W: Work>(
        &self,
        message: &Message<'_>,
        ranges: &W::Ranges,
    ) -> Result<Job<W>, MessageError> {
        let (mut params, mut work) = (Params::default(), W::default());
        let (entry, own) = self.read_values(message, &mut params)?;
        let (order, number) = (params.number(Field::Order), params.number(Field::Number));
        let (Role::Job, Some(number), Some(own)) = (entry.role, number, own) else {
            return Err(MessageError::NotExpected { role: entry.role });
        };
        entry.read_work(message, own, ranges, &mut work)?;
        Ok(Job { order: order.unwrap_or(0), number, work })
    }

    /// Reads the values of a message; returns its entry and a job's own fields.
    #[inline(always)]
    pub(crate) fn read_values<'m>(
        &self,
        message: &Message<'m>,
        params: &mut Params,
    ) -> Result<(&'static Entry, Option<Values<'m>>), MessageError> {
        let Some(entry) = self.find(message.name) else {
            return Err(MessageError::UnknownName { name: Name::beginning(message.name.chars()) });
        };
        *params = Params::default();
        if !entry.header.is_empty() {
            entry.read_header(message, params)?;
        }
        let (mut values, mut own) = (message.fields, None);
        let mut fields = entry.fields.iter();
        while let Some(field) = fields.next() {
            let read = match field {
                Field::Work if fields.len() == 0 => {
                    (own, values) = (Some(values), Values::NONE);
                    break;
                }
                Field::Work => {
                    let split = values
                        .split(fields.len())
                        .map(|(before, after)| (own, values) = (Some(before), after));
                    split.ok_or(ValueFault::Missing)
                }
                field => params.read(field, &mut values),
            };
            if let Err(misfit) = read {
                entry.wrong(message, fields.len(), misfit)?;
            }
        }
        if !values.is_empty() {
            return Err(entry.miscounted(message));
        }
        Ok((entry, own))
    }

    /// Returns a job's own fields as they are in its message; none if the message is not a job, or cannot be read.
    pub fn work_values<'m>(&self, message: &Message<'m>) -> impl Iterator<Item = Value<'m>> + use<'m> {
        let read = self.read_values(message, &mut Params::default()).ok();
        let own = read.and_then(|(entry, own)| own.filter(|_| entry.role == Role::Job));
        own.unwrap_or(Values::NONE).iter()
    }

    /// Writes the message with this role and these values, and returns its length. An absent value is written empty; a role
    /// that the table lacks is written as filler.
    ///
    /// # Errors
    /// See [`EncodeError`]; the contents of `out` are then undefined.
    pub fn write(&self, role: Role, params: &Params, out: &mut [u8]) -> Result<usize, EncodeError> {
        let entry = self.entry(role).or_else(|| self.entry(Role::Filler)).ok_or(EncodeError::NoName)?;
        self.write_entry(entry, params, out, |writer| writer.empty())
    }

    /// Writes a job, and returns the length of its message.
    ///
    /// # Errors
    /// The first field that does not fit; the contents of `out` are then undefined.
    pub fn write_job<W: Work>(
        &self,
        job: &Job<W>,
        ranges: &W::Ranges,
        out: &mut [u8],
    ) -> Result<usize, EncodeError> {
        let entry = self.entry(Role::Job).ok_or(EncodeError::NoName)?;
        let params = Params::default().with(Field::Order, job.order).with(Field::Number, job.number);
        self.write_entry(entry, &params, out, |writer| job::write(job.work, ranges, writer))
    }

    /// Writes a message, with a job's own fields by `own`.
    #[inline(always)]
    fn write_entry(
        &self,
        entry: &Entry,
        params: &Params,
        out: &mut [u8],
        own: impl Fn(&mut Writer<'_>),
    ) -> Result<usize, EncodeError> {
        let mut writer = Writer::new(out, self.charset, entry.name);
        entry.header.iter().for_each(|field| params.write(*field, &mut writer));
        writer.data();
        for field in entry.fields {
            if matches!(field, Field::Work) { own(&mut writer) } else { params.write(*field, &mut writer) }
        }
        writer.finish()
    }

    /// Adds the values that this table does not send: those of the active order, and the first job.
    #[inline(always)]
    pub(crate) fn complete(&self, role: Role, params: &mut Params, active: u16) {
        use Role::{Job, JobAck, JobRequest, OrderEnd, OrderInterrupt, OrderStart, Pause};
        match role {
            OrderStart => params.add(Field::Number, 1),
            Job | JobAck | JobRequest | Pause | OrderEnd | OrderInterrupt => params.add(Field::Order, active),
            _ => {}
        }
    }
}

impl Default for Dialect {
    fn default() -> Self {
        Self::DEFAULT
    }
}

impl Entry {
    fn all(&self) -> impl Iterator<Item = &'static Field> {
        self.header.iter().chain(self.fields)
    }

    fn check(&self) -> Result<(), ConfigError> {
        let (role, all) = (self.role, || self.all());
        let found = self.header.len().max(self.fields.len());
        if found > Dialect::MAX_FIELDS {
            return Err(ConfigError::TooManyFields { role, found });
        }
        let default = DEFAULT_TABLE.iter().find(|entry| entry.role == role);
        let known = default.map_or(&[Field::Order, Field::Number, Field::Value][..], |entry| entry.fields);
        let used = || all().filter(|field| !matches!(field, Field::Constant(_) | Field::Unused));
        let twice = used().any(|field| used().filter(|other| *other == field).count() > 1);
        let foreign = used().any(|field| default.is_some() && !known.contains(field));
        if twice || foreign || self.header.contains(&Field::Work) {
            return Err(ConfigError::Fields { role });
        }
        for field in default.map_or(&[][..], |entry| entry.fields) {
            if !all().any(|other| other == field) && !is_optional(role, Some(*field)) {
                return Err(ConfigError::MissingField { role, field: *field });
            }
        }
        Ok(())
    }

    /// Reads a job's own fields.
    #[inline(always)]
    pub(crate) fn read_work<W: Work>(
        &self,
        message: &Message<'_>,
        own: Values<'_>,
        ranges: &W::Ranges,
        work: &mut W,
    ) -> Result<(), MessageError> {
        let (found, limit) = (own.len() + "#>".len(), job::MAX_FIELDS_LEN);
        if found > limit {
            return Err(MessageError::JobTooLong { found, limit });
        }
        job::read(own, ranges, work).map_err(|unread| match unread {
            job::ReadError::Field(error) => MessageError::Field(error),
            job::ReadError::Count(count) => {
                let expected = self.fields.len() - 1 + count;
                MessageError::FieldCount { expected, found: message.fields.count() }
            }
        })
    }

    fn read_header(&self, message: &Message<'_>, params: &mut Params) -> Result<(), MessageError> {
        let mut values = message.header;
        for (value, field) in self.header.iter().enumerate() {
            params.read(field, &mut values).map_err(|_| MessageError::Header { value })?;
        }
        let value = self.header.len();
        if values.is_empty() { Ok(()) } else { Err(MessageError::Header { value }) }
    }

    /// Returns the error of the field that is followed by `after` others, if it is an error.
    #[cold]
    #[inline(never)]
    fn wrong(&self, message: &Message<'_>, after: usize, misfit: ValueFault) -> Result<(), MessageError> {
        let (expected, found) = (self.fields.len(), message.fields.count());
        let is_job = self.fields.contains(&Field::Work);
        // Report first that a job has too few fields.
        if misfit == ValueFault::Missing || is_job && found + 1 < expected {
            // A single empty value is the same on the wire as no value.
            let may_be_absent =
                |field: &Field| *field == Field::Unused || field.row().is_some_and(|row| row.may_be_empty);
            let is_empty = matches!(self.fields, [field] if may_be_absent(field));
            return if is_empty { Ok(()) } else { Err(self.miscounted(message)) };
        }
        let index = expected - after - 1;
        let is_after_own = self.fields.iter().take(index).any(|field| *field == Field::Work);
        let field = if is_after_own { found - after - 1 } else { index };
        Err(match misfit {
            ValueFault::Constant => MessageError::NotTheConstant { field },
            ValueFault::OutOfRange { found, min, max } => MessageError::OutOfRange { field, found, min, max },
            ValueFault::NotANumber | ValueFault::Missing => MessageError::NotANumber { field },
        })
    }

    #[cold]
    fn miscounted(&self, message: &Message<'_>) -> MessageError {
        MessageError::FieldCount { expected: self.fields.len(), found: message.fields.count() }
    }
}
