//! Beginnings and ends of orders.

use std::collections::BTreeSet;

use super::{Conversation, Kind, Proof, Run, only, repeats};
use crate::draft::MIN_SIGHTINGS;

impl<'a> Conversation<'a> {
    /// Adds the messages that begin an order, and the robot's answers to begin and end.
    pub(super) fn prove_orders(&self, proof: &mut Proof) {
        if let Some(at) = self.order {
            self.set(proof, self.job, at, "order");
        }
        for role in ["job_request", "job_ack", "pause"] {
            let Some((index, kind)) = proof.of(role).and_then(|index| Some((index, self.kinds.get(index)?)))
            else {
                continue;
            };
            let order = |when: usize| Some(self.runs.get(self.run_at(index, when)?)?.order.as_str());
            for at in (0..kind.width()).filter(|at| repeats(kind, *at, order)) {
                self.set(proof, index, at, "order");
            }
        }
        let start = only(self.unknown(true).filter_map(|(index, kind)| Some((index, self.begins(kind)?))));
        if let Some((index, at)) = start {
            proof.roles.insert("order_start", index);
            self.set(proof, index, at, "order");
            let acks = self.unknown(false).filter(|(index, _)| proof.is_free(*index));
            if let Some((index, at)) =
                only(acks.filter_map(|(ack, kind)| Some((ack, self.accepts(kind, index)?))))
            {
                proof.roles.insert("order_ack", index);
                self.set(proof, index, at, "order");
            }
        }
        let ended = self.unknown(false).filter(|(index, _)| proof.is_free(*index));
        if let Some((index, at)) =
            only(ended.filter_map(|(index, kind)| Some((index, self.confirms(index, kind)?))))
        {
            proof.roles.insert("end_ack", index);
            self.set(proof, index, at, "ended");
        }
    }

    /// Returns the runs before and after a message; `None` within a run.
    fn between(&self, when: usize) -> Option<(Option<&Run>, Option<&Run>)> {
        let next = self.runs.iter().position(|run| when < run.first);
        let before = next.unwrap_or(self.runs.len()).checked_sub(1).and_then(|at| self.runs.get(at));
        let is_within = before.is_some_and(|run| when < run.last);
        (!is_within).then(|| (before, next.and_then(|at| self.runs.get(at))))
    }

    /// Returns whether a message has this value.
    fn has(values: &[String], order: &str) -> bool {
        values.iter().any(|value| value == order)
    }

    /// Returns the robot's messages after a run and before `when`.
    fn robot_since(&self, run: Option<&Run>, when: usize) -> impl Iterator<Item = &'a [String]> {
        let since = run.map_or(0, |run| run.last);
        let robot = self.kinds.iter().filter(|kind| kind.side != self.pc);
        let all = robot.flat_map(|kind| &kind.all).filter(move |(at, _)| since <= *at && *at < when);
        all.map(|(_, values)| values.as_slice())
    }

    /// Returns the index of the order in a message that begins it: the PC's first message that names the order, before the
    /// robot does.
    fn begins(&self, kind: &Kind) -> Option<usize> {
        let places = (0..kind.width()).filter(|place| {
            let mut orders = BTreeSet::new();
            for (at, values) in &kind.all {
                let Some((before, next)) = self.between(*at) else { return false };
                let Some(next) = next else { continue };
                if values.get(*place) != Some(&next.order) {
                    return false;
                }
                let since = before.map_or(0, |run| run.last);
                let mut of_pc = self.unknown(true).flat_map(|(_, other)| &other.all);
                let is_first = !of_pc
                    .any(|(when, values)| (since..*at).contains(when) && Self::has(values, &next.order));
                let mut robot = self.robot_since(before, *at).peekable();
                let has_spoken = robot.peek().is_some();
                if is_first && has_spoken && !robot.any(|values| Self::has(values, &next.order)) {
                    orders.insert(&next.order);
                }
            }
            orders.len() >= MIN_SIGHTINGS
        });
        only(places)
    }

    /// Returns the index of the order in the robot's answer to that message: its first message that names the order.
    fn accepts(&self, kind: &Kind, start: usize) -> Option<usize> {
        let starts = self.kinds.get(start)?;
        let places = (0..kind.width()).filter(|place| {
            let mut orders = BTreeSet::new();
            for (at, values) in &kind.all {
                let Some((before, next)) = self.between(*at) else { return false };
                let Some(next) = next.filter(|next| values.get(*place) == Some(&next.order)) else {
                    continue;
                };
                let since = before.map_or(0, |run| run.last);
                let began = starts
                    .all
                    .iter()
                    .any(|(when, values)| (since..*at).contains(when) && Self::has(values, &next.order));
                if began && !self.robot_since(before, *at).any(|values| Self::has(values, &next.order)) {
                    orders.insert(&next.order);
                }
            }
            orders.len() >= MIN_SIGHTINGS
        });
        only(places)
    }

    /// Returns the index of the order in the robot's report of its end: no other message that only the robot sends names the
    /// order after the PC has ended it.
    fn confirms(&self, index: usize, kind: &Kind) -> Option<usize> {
        let places = (0..kind.width()).filter(|place| {
            let mut orders = BTreeSet::new();
            for (at, values) in &kind.all {
                let Some((before, next)) = self.between(*at) else { return false };
                let Some(run) = before.filter(|run| values.get(*place) == Some(&run.order)) else {
                    continue;
                };
                let of_pc = self.unknown(true).flat_map(|(_, other)| &other.all);
                let mut closing = of_pc.filter(|(when, _)| run.last < *when && when < at);
                let Some((closed, _)) = closing.find(|(_, values)| Self::has(values, &run.order)) else {
                    continue;
                };
                let until = next.map_or(usize::MAX, |next| next.first);
                let others = self
                    .kinds
                    .iter()
                    .enumerate()
                    .filter(|(other, _)| *other != index && self.is_robot_only(*other));
                let alone = !others
                    .flat_map(|(_, other)| &other.all)
                    .any(|(when, values)| (*closed..until).contains(when) && Self::has(values, &run.order));
                let has_gone_on = self
                    .kinds
                    .iter()
                    .any(|it| it.side == self.pc && it.all.iter().any(|(when, _)| when > at));
                if alone && has_gone_on {
                    orders.insert(&run.order);
                }
            }
            orders.len() >= MIN_SIGHTINGS
        });
        only(places)
    }
}
