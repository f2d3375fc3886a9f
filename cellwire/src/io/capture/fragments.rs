//! IP packets that were divided on their way.

use std::collections::VecDeque;
use std::net::IpAddr;

use etherparse::IpNumber;
use etherparse::defrag::IpDefragBuf;

use super::fault::Fault;
use super::network::{Fragment, Ip};

/// The number of packets that may be incomplete at once, each of at most 64 KiB; with more, the oldest counts as lost.
const MAX_INCOMPLETE: usize = 64;

/// Packets of which some fragments were captured, the oldest first.
#[derive(Debug, Default)]
pub(super) struct Fragments(VecDeque<(Key, IpDefragBuf)>);

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Key {
    source: IpAddr,
    destination: IpAddr,
    identification: u32,
    protocol: IpNumber,
}

impl Fragments {
    /// Adds a fragment: the payload of the packet if it is whole, and the outcome of others.
    pub(super) fn add(&mut self, ip: &Ip<'_>, fragment: Fragment) -> (Option<Vec<u8>>, Vec<Fault>) {
        let Ip { source, destination, protocol, payload, missing, .. } = *ip;
        let key = Key { source, destination, identification: fragment.identification, protocol };
        let at = self.0.iter().position(|(known, _)| *known == key);
        let (_, mut packet) = match at.and_then(|at| self.0.remove(at)) {
            Some(known) => known,
            None => (key, IpDefragBuf::new(protocol, Vec::new(), Vec::new())),
        };
        let why = if missing > 0 {
            Some("a fragment was cut off by the capture")
        } else if packet.add(fragment.offset, !fragment.is_last, payload).is_err() {
            Some("fragments contradict each other")
        } else {
            None
        };
        if let Some(why) = why {
            let mut fault = lost(&key, &packet, why);
            if let Fault::Fragments { captured, .. } = &mut fault {
                *captured += payload.len();
            }
            return (None, vec![fault]);
        }
        if packet.is_complete() {
            return (Some(packet.take_bufs().0), Vec::new());
        }
        self.0.push_back((key, packet));
        let faults = match self.0.len() > MAX_INCOMPLETE {
            true => {
                self.0.pop_front().map(|(key, packet)| lost(&key, &packet, "too many incomplete datagrams"))
            }
            false => None,
        };
        (None, faults.into_iter().collect())
    }

    /// Called when the capture has ended.
    pub(super) fn finish(self) -> impl Iterator<Item = Fault> {
        self.0.into_iter().map(|(key, packet)| lost(&key, &packet, "the rest is not in the capture"))
    }
}

fn lost(key: &Key, packet: &IpDefragBuf, why: &'static str) -> Fault {
    let Key { source, destination, identification, .. } = *key;
    let captured = packet.sections().iter().map(|it| usize::from(it.end - it.start)).sum();
    Fault::Fragments { source, destination, identification, captured, why }
}
