//! The fields of a plant's jobs as data, in wire sequence; in a file the tables `[[job]]`.

use std::sync::Arc;

use kawasaki_msg::{
    Bounds, Charset, DATA, Decimal, Dialect, END, FieldError, FieldFault, FieldVisitor, Message,
    MessageError, Name, SEPARATOR, START, Text, Unfit, Work,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::bytes::written;
use crate::settings::RefusedSetting;

/// The most fields of a job.
pub const MAX_FIELDS: usize = 24;

/// The most characters of a text in a job.
pub const MAX_TEXT: usize = 32;

/// The limit of a number without a given range: an AS program's real represents whole numbers up to it exactly.
const WIDEST: i32 = 9_999_999;

/// The fields of a job. They are shared by readers and writers of jobs.
#[derive(Debug, Clone)]
pub struct Layout(Arc<[Field]>);

/// One field.
#[derive(Debug, Clone, PartialEq)]
pub struct Field {
    /// The name that people use for the field; it is not on the wire.
    pub name: String,
    /// The type and range of the value.
    pub holds: FieldType,
    /// The value of the field if a job does not give one; `None`: every job must give one.
    pub default: Option<AnyValue>,
}

/// The type and range of a field's value. The ranges include both ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FieldType {
    /// A number, in units of its last decimal.
    Number {
        /// The number of decimals, 0 to 9.
        places: u8,
        /// The least value, in units of the last decimal.
        min: i32,
        /// The greatest value, in units of the last decimal.
        max: i32,
    },
    /// A text, in the plant's character set.
    Text {
        /// The least number of characters.
        min: usize,
        /// The greatest number of characters.
        max: usize,
    },
}

/// A job of any layout.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AnyWork {
    values: [AnyValue; MAX_FIELDS],
}

/// A value of a job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum AnyValue {
    /// In units of its last decimal.
    Number(i32),
    /// A text as it is on the wire.
    Text(Text<MAX_TEXT>),
}

/// The field as it is in a file of settings.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct GivenField {
    name: String,
    kind: Kind,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    places: Option<u8>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    range: Option<[Value; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    length: Option<[usize; 2]>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    default: Option<Value>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "lowercase")]
enum Kind {
    Whole,
    Decimal,
    Text,
}

impl Layout {
    /// Returns the layout for the drawing's lines within these bounds: the default for a plant without a `job`.
    pub fn line(Bounds { min, max }: Bounds) -> Self {
        let number = |name: &str, min, max| Field {
            name: name.into(),
            holds: FieldType::Number { places: 0, min, max },
            default: None,
        };
        let (x, y) = (|name| number(name, min.x, max.x), |name| number(name, min.y, max.y));
        Self([number("kind", 1, 2), x("x1"), y("y1"), x("x2"), y("y2")].into())
    }

    /// Reads the layout of the tables `[[job]]`.
    ///
    /// # Errors
    /// The contradiction, with the name of the setting.
    pub fn read(given: &[Value], charset: Charset) -> Result<Self, RefusedSetting> {
        let mut fields: Vec<Field> = Vec::new();
        if given.is_empty() || given.len() > MAX_FIELDS {
            return Err(refused("job", &format!("a job has 1 to {MAX_FIELDS} fields, not {}", given.len())));
        }
        for (place, value) in given.iter().enumerate() {
            let table = format!("job.{place}");
            let title =
                value.get("name").and_then(Value::as_str).map(|name| format!(" `{}`", name.escape_debug()));
            let what = format!("field {}{} of a job", place + 1, title.unwrap_or_default());
            let found = GivenField::deserialize(value)
                .map_err(|error| {
                    let error = error.to_string();
                    // The line of the file is that of the key.
                    let key = error.strip_prefix("unknown field `").and_then(|rest| rest.split_once('`'));
                    (key.map_or_else(String::new, |(key, _)| key.to_owned()), error)
                })
                .and_then(|given| given.field(charset).map_err(|(key, why)| (key.to_owned(), why)))
                .map_err(|(key, why)| {
                    refused(format!("{table}.{key}").trim_end_matches('.'), &format!("{what}: {why}"))
                })?;
            if fields.iter().any(|field| field.name == found.name) {
                return Err(refused(
                    &format!("{table}.name"),
                    &format!("{what}: there are two of this name"),
                ));
            }
            fields.push(found);
        }
        Ok(Self(fields.into()))
    }

    /// Returns the layout as tables of a file of settings.
    pub fn given(&self) -> Vec<Value> {
        let field = |(place, field): (usize, &Field)| {
            let default = field.default.map(|value| {
                let mut work = AnyWork::default();
                work.set(place, value);
                self.show(place, &work)
            });
            let number = |units, places| Value::from(Decimal { units, places }.to_string());
            let (kind, places, range, length) = match field.holds {
                FieldType::Number { places: 0, min, max } => {
                    (Kind::Whole, None, Some([min.into(), max.into()]), None)
                }
                FieldType::Number { places, min, max } => {
                    (Kind::Decimal, Some(places), Some([number(min, places), number(max, places)]), None)
                }
                FieldType::Text { min, max } => (Kind::Text, None, None, Some([min, max])),
            };
            let default = default.map(Value::from);
            serde_json::to_value(GivenField {
                name: field.name.clone(),
                kind,
                places,
                range,
                length,
                default,
            })
        };
        self.0.iter().enumerate().filter_map(|field_at| field(field_at).ok()).collect()
    }

    /// Returns the fields in the sequence of the wire.
    pub fn fields(&self) -> &[Field] {
        &self.0
    }

    /// Returns whether a job is a line of a drawing, for which kawasaki-msg has a type.
    pub fn is_line(&self) -> bool {
        let line = Self::default();
        let is_alike = |(field, of_line): (&Field, &Field)| {
            field.name == of_line.name && matches!(field.holds, FieldType::Number { places: 0, .. })
        };
        self.0.len() == line.0.len() && self.0.iter().zip(&*line.0).all(is_alike)
    }

    /// Returns the index of a field.
    pub fn place(&self, name: &str) -> Option<usize> {
        self.0.iter().position(|field| field.name == name)
    }

    /// Returns the job whose fields have these texts, read as from the wire.
    ///
    /// # Errors
    /// The first field that does not fit.
    pub fn job(&self, texts: &[&str], charset: Charset) -> Result<AnyWork, FieldError> {
        for (field, text) in self.0.iter().zip(texts) {
            // A mark would end the field, and is not part of a number either.
            let fault = text.chars().find_map(|c| match u8::try_from(c) {
                Err(_) => Some(FieldFault::Character { found: c }),
                Ok(found) if [START, END, SEPARATOR, DATA].contains(&found) => {
                    Some(FieldFault::Reserved { found })
                }
                Ok(byte) => {
                    let is_text = matches!(field.holds, FieldType::Text { .. });
                    (is_text && !charset.has(byte)).then_some(FieldFault::Character { found: c })
                }
            });
            if let Some(fault) = fault {
                return Err(FieldError { field: Name::of(&field.name), fault });
            }
        }
        let unread = FieldError { field: Name::of("job"), fault: FieldFault::Missing };
        let fields = [&["1", "1"], texts].concat();
        let wire = written(Charset::Latin1, NAME, &[""; 0], &fields).map_err(|_| unread)?;
        let (message, _) = Message::decode(&wire, Charset::Latin1).ok().flatten().ok_or(unread)?;
        let read = Dialect::DEFAULT.read_job::<AnyWork>(&message, self);
        read.map(|job| job.work).map_err(|error| match error {
            MessageError::Field(error) => error,
            _ => unread,
        })
    }

    /// Returns a value in its form on the wire.
    pub fn show(&self, place: usize, work: &AnyWork) -> String {
        match (self.0.get(place).map(|field| field.holds), work.get(place)) {
            (Some(FieldType::Number { places, .. }), AnyValue::Number(units)) => {
                Decimal { units, places }.to_string()
            }
            (_, AnyValue::Number(units)) => units.to_string(),
            (_, AnyValue::Text(text)) => text.to_string(),
        }
    }
}

/// The name of a job's message in the default table.
const NAME: &str = "Tyo";

impl Default for Layout {
    fn default() -> Self {
        Self::line(Bounds::WIDEST)
    }
}

impl GivenField {
    /// Returns the field; or the invalid key, and the reason.
    fn field(self, charset: Charset) -> Result<Field, (&'static str, String)> {
        let Self { name, kind, places, range, length, default } = self;
        let is_word = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if !(1..=15).contains(&name.len()) || !name.chars().all(is_word) {
            return Err(("name", "a name has 1 to 15 letters, digits and _".into()));
        }
        let only = |key: &'static str, is_given: bool, of: Kind| match is_given && kind != of {
            true => Err((key, format!("`{key}` is of a field of the kind {}", name_of(of)))),
            false => Ok(()),
        };
        only("places", places.is_some(), Kind::Decimal)?;
        only("length", length.is_some(), Kind::Text)?;
        let holds = if kind == Kind::Text {
            if range.is_some() {
                return Err(("range", "a text has a `length`, such as [1, 8], and no range".into()));
            }
            let [min, max] = length.unwrap_or([0, MAX_TEXT]);
            if min > max || max > MAX_TEXT {
                return Err(("length", format!("give [LEAST, MOST] characters, of 0 to {MAX_TEXT}")));
            }
            FieldType::Text { min, max }
        } else {
            let places = match (kind, places) {
                (Kind::Whole, _) => 0,
                (_, Some(places @ 1..=Decimal::MAX_PLACES)) => places,
                (_, Some(_)) => return Err(("places", format!("give 1 to {}", Decimal::MAX_PLACES))),
                (_, None) => return Err(("kind", "a decimal has `places`, such as 3".into())),
            };
            let [min, max] = match &range {
                None => [-WIDEST, WIDEST],
                Some([min, max]) => [units(min, places)?, units(max, places)?],
            };
            if min > max {
                return Err(("range", "the range is empty: give [LEAST, MOST]".into()));
            }
            FieldType::Number { places, min, max }
        };
        let field = Field { name, holds, default: None };
        let Some(default) = default else { return Ok(field) };
        let alone = Layout([field.clone()].into());
        let value = alone.job(&[&plain(&default)], charset).map_err(|error| {
            ("default", format!("its default {} {}", plain(&default).escape_debug(), error.fault))
        })?;
        Ok(Field { default: Some(value.get(0)), ..field })
    }
}

/// Returns the end of a range, in units of the last decimal.
fn units(value: &Value, places: u8) -> Result<i32, (&'static str, String)> {
    let holds = FieldType::Number { places, min: i32::MIN, max: i32::MAX };
    let any = Layout([Field { name: "range".into(), holds, default: None }].into());
    match any.job(&[&plain(value)], Charset::Ascii).map(|job| job.get(0)) {
        Ok(AnyValue::Number(units)) => Ok(units),
        Ok(AnyValue::Text(_)) => Ok(0),
        Err(error) => Err(("range", format!("its end {} {}", plain(value).escape_debug(), error.fault))),
    }
}

fn name_of(kind: Kind) -> &'static str {
    match kind {
        Kind::Whole => "whole",
        Kind::Decimal => "decimal",
        Kind::Text => "text",
    }
}

fn plain(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

fn refused(name: &str, text: &str) -> RefusedSetting {
    RefusedSetting { name: name.into(), text: text.into() }
}

impl AnyWork {
    /// Returns the value of a field by its index.
    pub fn get(&self, place: usize) -> AnyValue {
        self.values.get(place).copied().unwrap_or_default()
    }

    /// Sets the value of a field by its place.
    pub fn set(&mut self, place: usize, value: AnyValue) {
        if let Some(known) = self.values.get_mut(place) {
            *known = value;
        }
    }

    /// Returns the number of a field by its index; 0 if the field is a text.
    pub fn number(&self, place: usize) -> i32 {
        if let AnyValue::Number(units) = self.get(place) { units } else { 0 }
    }
}

impl Work for AnyWork {
    type Ranges = Layout;

    fn fields<F: FieldVisitor>(&mut self, layout: &Layout, fields: &mut F) -> Result<(), Unfit> {
        for (Field { name, holds, .. }, value) in layout.fields().iter().zip(&mut self.values) {
            match *holds {
                FieldType::Number { places, min, max } => {
                    let mut units = if let AnyValue::Number(units) = value { *units } else { 0 };
                    fields.decimal(name, &mut units, places, min..=max)?;
                    *value = AnyValue::Number(units);
                }
                FieldType::Text { min, max } => {
                    let mut text = if let AnyValue::Text(text) = value { *text } else { Text::EMPTY };
                    fields.text(name, &mut text, min..=max)?;
                    *value = AnyValue::Text(text);
                }
            }
        }
        Ok(())
    }
}

impl Default for AnyWork {
    fn default() -> Self {
        Self { values: [AnyValue::default(); MAX_FIELDS] }
    }
}

impl Default for AnyValue {
    fn default() -> Self {
        Self::Number(0)
    }
}
