//! The files and queues of the simulated controller.

use core::str::FromStr;

use fanuc_hmi_modbus::{Exception, Words, WordsMut};

/// Lists of registers by number: `NUMBER:VALUE VALUE…` with commas between them, such as `4:10 20 30,5:1`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Lists(Vec<(u16, Vec<u16>)>);

/// An item that is not a list.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0} is not NUMBER:VALUE VALUE… with numbers of 0 to 65535, such as 4:10 20 30")]
pub struct NoList(String);

impl FromStr for Lists {
    type Err = NoList;

    fn from_str(text: &str) -> Result<Self, NoList> {
        let list = |item: &str| {
            let (number, values) = item.split_once(':')?;
            let values = values.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
            Some((number.trim().parse().ok()?, values))
        };
        let items = text.split(',').filter(|item| !item.trim().is_empty());
        items.map(|item| list(item).ok_or_else(|| NoList(item.into()))).collect::<Result<_, _>>().map(Self)
    }
}

impl Lists {
    /// Returns the registers of a list; exception 2 if it is missing, exception 1 if there are no lists.
    ///
    /// # Errors
    /// The exception to answer with.
    pub fn get(&mut self, number: u16) -> Result<&mut [u16], Exception> {
        let without =
            if self.0.is_empty() { Exception::IllegalFunction } else { Exception::IllegalDataAddress };
        let found = self.0.iter_mut().find(|(found, _)| *found == number);
        found.map(|(_, values)| values.as_mut_slice()).ok_or(without)
    }

    /// Reads a run of a list.
    ///
    /// # Errors
    /// The exception to answer with.
    pub fn read(&mut self, number: u16, first: u16, out: &mut WordsMut<'_>) -> Result<(), Exception> {
        out.copy_from(run(self.get(number)?, first, out.len())?);
        Ok(())
    }

    /// Writes a run of a list.
    ///
    /// # Errors
    /// The exception to answer with.
    pub fn write(&mut self, number: u16, first: u16, values: Words<'_>) -> Result<(), Exception> {
        values.copy_to(run(self.get(number)?, first, values.len())?);
        Ok(())
    }
}

fn run(values: &mut [u16], first: u16, count: usize) -> Result<&mut [u16], Exception> {
    let first = usize::from(first);
    values.get_mut(first..first + count).ok_or(Exception::IllegalDataAddress)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_have_a_number_and_values() {
        let mut lists: Lists = "4:10 20 30, 65535:".parse().unwrap();
        assert_eq!(lists.write(4, 1, Words::from(&[7, 8])), Ok(()));
        assert_eq!(lists.get(4), Ok(&mut [10, 7, 8][..]));
        assert_eq!(lists.write(4, 2, Words::from(&[7, 8])), Err(Exception::IllegalDataAddress));
        assert_eq!(lists.get(65535).map(|values| values.len()), Ok(0));
        assert_eq!(lists.get(5), Err(Exception::IllegalDataAddress));
        assert_eq!(Lists::default().get(4), Err(Exception::IllegalFunction));
        for wrong in ["4", "65536:1", ":1", "4:65536", "4:a"] {
            assert_eq!(wrong.parse::<Lists>(), Err(NoList(wrong.into())));
        }
    }
}
