//! The device identification of the simulated controller.

use core::str::FromStr;

use fanuc_hmi_modbus::limit;

/// The objects of a device's identification: `0:VENDOR,1:CODE,2:REVISION`, an id and its text, up to 244 characters of Latin-1.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Identification(Vec<(u8, Vec<u8>)>);

/// An item that is not an object.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error(
    "identification={0} is not ID:TEXT with an id of 0 to 255 and up to 244 characters of Latin-1, such as 0:FANUC"
)]
pub struct NoObject(String);

impl FromStr for Identification {
    type Err = NoObject;

    fn from_str(text: &str) -> Result<Self, NoObject> {
        let object = |item: &str| {
            let (id, text) = item.split_once(':')?;
            let value: Vec<u8> = text.chars().map(u8::try_from).collect::<Result<_, _>>().ok()?;
            let id = id.trim().parse().ok()?;
            (value.len() <= limit::DEVICE_OBJECT).then_some((id, value))
        };
        let items = text.split(',').filter(|item| !item.trim().is_empty());
        items
            .map(|item| object(item).ok_or_else(|| NoObject(item.into())))
            .collect::<Result<_, _>>()
            .map(Self)
    }
}

impl Identification {
    /// Writes the value of an object, and returns its length; `None` if there is no such object.
    pub fn write(&self, id: u8, out: &mut [u8]) -> Option<usize> {
        let (_, value) = self.0.iter().find(|(found, _)| *found == id)?;
        out.get_mut(..value.len())?.copy_from_slice(value);
        Some(value.len())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn objects_have_an_id_and_a_text() {
        let objects: Identification = "0:FANUC, 128:\u{fc}:1".parse().unwrap();
        let mut out = [0; 5];
        assert_eq!((objects.write(0, &mut out), &out), (Some(5), b"FANUC"));
        assert_eq!((objects.write(128, &mut out), &out[..3]), (Some(3), &b"\xfc:1"[..]));
        assert_eq!(objects.write(1, &mut out), None);
        assert_eq!("".parse(), Ok(Identification::default()));
        let long = format!("1:{}", "a".repeat(245));
        for wrong in ["FANUC", "256:FANUC", "-1:a", ":a", "1:\u{100}", &long] {
            let error = wrong.parse::<Identification>().unwrap_err();
            assert_eq!(error, NoObject(wrong.into()), "{error}");
        }
    }
}
