//! The functions of a handle for the device, its files and its serial line, not for its tables.

use std::vec::Vec;

use super::{Client, Error};
use crate::message::{FileRange, FileRecord, Reply, Request, Words};
use crate::registers::CommEvents;

impl Client {
    /// Reads the exception status (function 7, of a serial line): eight outputs of the device.
    pub async fn read_exception_status(&self) -> Result<u8, Error> {
        let status = |reply: Reply<'_>| match reply {
            Reply::ExceptionStatus(status) => Some(status),
            _ => None,
        };
        self.read(&Request::ReadExceptionStatus, status).await
    }

    /// Performs a diagnostic of the serial line (function 8) and returns its words; sends 1 to 125 words for subfunction 0,
    /// which returns them, otherwise 1.
    pub async fn diagnose(&self, subfunction: u16, words: &[u16]) -> Result<Vec<u16>, Error> {
        self.words(&Request::Diagnostics { subfunction, data: Words::from(words) }).await
    }

    /// Reads the event counter (function 11, of a serial line): FFFF if the device is busy, otherwise 0; and the number of
    /// requests that it has executed.
    pub async fn comm_event_counter(&self) -> Result<(u16, u16), Error> {
        let counter = |reply: Reply<'_>| match reply {
            Reply::CommEventCounter { status, events } => Some((status, events)),
            _ => None,
        };
        self.read(&Request::GetCommEventCounter, counter).await
    }

    /// Reads the event log (function 12, of a serial line): the counters of the device, and its last events, the last one
    /// first.
    pub async fn comm_event_log(&self) -> Result<(CommEvents, Vec<u8>), Error> {
        let log = |reply: Reply<'_>| match reply {
            Reply::CommEventLog { status, events, messages, log } => {
                Some((CommEvents { status, events, messages, logged: log.len() }, log.to_vec()))
            }
            _ => None,
        };
        self.read(&Request::GetCommEventLog, log).await
    }

    /// Reads the device's description of itself (function 17): an id, FF if the device runs, further bytes.
    pub async fn report_server_id(&self) -> Result<Vec<u8>, Error> {
        let id = |reply: Reply<'_>| match reply {
            Reply::ServerId(id) => Some(id.to_vec()),
            _ => None,
        };
        self.read(&Request::ReportServerId, id).await
    }

    /// Reads the registers of these runs in files, 1 to 35 of them (function 20).
    pub async fn read_files(&self, ranges: &[FileRange]) -> Result<Vec<Vec<u16>>, Error> {
        let groups = |reply: Reply<'_>| match reply {
            Reply::FileRecords(groups) => Some(groups.iter().map(Words::to_vec).collect()),
            _ => None,
        };
        self.read(&Request::ReadFileRecord(ranges.into()), groups).await
    }

    /// Writes registers in files (function 21).
    pub async fn write_files(&self, records: &[FileRecord<'_>]) -> Result<(), Error> {
        self.request(&Request::WriteFileRecord(records.into())).await.map(drop)
    }

    /// Reads the queue whose count has this address (function 24): its registers, at most 31, the oldest first. They stay in
    /// the queue.
    pub async fn read_fifo_queue(&self, address: u16) -> Result<Vec<u16>, Error> {
        self.words(&Request::ReadFifoQueue { address }).await
    }

    /// Reads the id and value of the objects of the device's identification of a category (1 basic, 2 regular, 3 extended)
    /// by function 43, in as many requests as the device needs.
    pub async fn read_device_identification(&self, category: u8) -> Result<Vec<(u8, Vec<u8>)>, Error> {
        let (mut objects, mut object) = (Vec::new(), 0);
        loop {
            let part = |reply: Reply<'_>| match reply {
                Reply::DeviceIdentification(part) => {
                    objects.extend(part.objects.iter().map(|(id, value)| (id, value.to_vec())));
                    // The next object must be a later one: otherwise the loop would not end.
                    Some((part.more && part.next > object).then_some(part.next))
                }
                _ => None,
            };
            match self.read(&Request::ReadDeviceIdentification { category, object }, part).await? {
                Some(next) => object = next,
                None => return Ok(objects),
            }
        }
    }
}
