use std::collections::BTreeMap;
use std::time::Duration;

use fastrand::Rng;

use super::world::{CELLS, NAMES, STEP, World, milliseconds};
use super::{LEASE, SILENT, Share, ShareEvent};
use crate::bucket::Rate;
use crate::commands::{CommandReport, Commands};
use crate::history::Entry;
use crate::report::{Command, Outcome};
use crate::store::Batch;

#[test]
fn no_two_bridges_have_a_cell_and_no_id_is_executed_twice_whatever_fails() {
    for seed in 0..16 {
        // The broker loses its stored pages, or the bridges lose their stores.
        let loses_stores = seed % 2 == 1;
        let mut world = World::new(seed, loses_stores);
        for round in 0..20 {
            let outage = (round % 5 == 4).then(|| world.now + milliseconds(world.rng.u64(500..20_000)));
            if outage.is_some() {
                world.bridges.iter_mut().for_each(|bridge| bridge.cut(&mut Rng::with_seed(round)));
                if !loses_stores {
                    world.stored.clear();
                }
            } else {
                world.fault();
            }
            for _ in 0..world.rng.u32(20..400) {
                world.step(outage.is_none_or(|until| until <= world.now));
                if world.rng.u8(..10) == 0 {
                    let is_new = world.rng.u8(..4) == 0;
                    world.send(is_new);
                }
            }
        }
        // Every fault is over.
        for _ in 0..600 {
            world.step(true);
        }
        let end = world.now + SILENT + 3 * LEASE;
        while world.now < end {
            world.step(true);
        }
        for (cell, name) in CELLS.iter().enumerate() {
            let first = NAMES.iter().max_by_key(|bridge| super::rank(bridge, name)).unwrap();
            assert_eq!(world.owners(cell), [*first], "seed {seed}: {name}");
        }
        assert!(world.takes > 2 * CELLS.len(), "nothing was taken over");
        // New commands are executed, with a time in their ids and without one.
        let before = world.unexecuted();
        for _ in 0..200 {
            world.send(true);
            (0..20).for_each(|_| world.step(true));
        }
        let executed = 200 - (world.unexecuted() - before);
        assert!(
            (100..200).contains(&executed),
            "seed {seed}: {executed} of 200, to two of three bridges each"
        );
        for _ in 0..400 {
            world.send(false);
            world.step(true);
        }
        let twice: Vec<_> = world.executed.iter().filter(|(_, times)| **times > 1).collect();
        assert!(twice.is_empty(), "seed {seed}: {twice:?}");
    }
}

#[test]
fn an_id_that_a_dead_bridge_has_executed_is_executed_by_no_other() {
    for seed in 0..4 {
        let (mut world, day) = (World::new(seed, false), Duration::from_secs(86_400));
        let run = |world: &mut World, seconds: u64| {
            let end = world.now + Duration::from_secs(seconds);
            while world.now < end {
                world.step(true);
                if world.rng.u8(..5) == 0 {
                    world.send(false);
                }
            }
        };
        run(&mut world, 8);
        for round in 0..16 {
            // One bridge runs alone, executes commands, and dies. The broker may lose its stored pages.
            let alone = world.rng.usize(..NAMES.len());
            let until = world.now + day;
            (0..NAMES.len()).for_each(|at| world.kill(at, until));
            if round % 8 == 5 {
                world.stored.clear();
            }
            world.bridges[alone].dead_until = Some(world.now);
            run(&mut world, 30);
            assert!((0..CELLS.len()).all(|cell| world.owners(cell) == [NAMES[alone]]));
            for _ in 0..10 {
                world.send(true);
                run(&mut world, 1);
            }
        }
        let twice: Vec<_> = world.executed.iter().filter(|(_, times)| **times > 1).collect();
        assert!(twice.is_empty(), "seed {seed}: {twice:?}");
        let is_plain = |id: &str| id.starts_with("plain");
        let plain = world.executed.keys().filter(|(_, id)| is_plain(id)).count();
        assert!(plain > 10, "seed {seed}: {plain} without a time were executed");
    }
}

#[test]
fn the_cells_of_a_bridge_that_dies_are_taken_within_half_a_minute_and_given_back() {
    let mut world = World::new(3, false);
    let run = |world: &mut World, seconds: u64| {
        let end = world.now + Duration::from_secs(seconds);
        while world.now < end {
            world.step(true);
        }
    };
    run(&mut world, 8);
    let before: Vec<_> = (0..CELLS.len()).map(|cell| world.owners(cell)[0].to_owned()).collect();
    assert!(before.iter().any(|owner| owner == NAMES[0]), "{before:?}");
    world.kill(0, world.now + Duration::from_secs(3600));
    run(&mut world, 20);
    for (cell, owner) in before.iter().enumerate() {
        let (now, is_dead) = (world.owners(cell), owner == NAMES[0]);
        assert!(now.len() == 1 && (now[0] == owner) != is_dead, "{owner}: {now:?}");
    }
    world.bridges[0].dead_until = Some(world.now);
    run(&mut world, 8);
    assert_eq!((0..CELLS.len()).map(|cell| world.owners(cell)[0]).collect::<Vec<_>>(), before);
}

const MAX_AGE: Duration = Duration::from_secs(30);

fn share(node: &str) -> Share {
    Share::new(node, &format!("store-{node}"), &["a".into(), "b".into()], MAX_AGE)
}

/// Returns commands that remember only one of another bridge, until this time.
fn commands(until: u64) -> Commands {
    let (rate, mut batch) = (Rate { per_second: 10.0, burst: 10 }, Batch::default());
    let (mut commands, _) = Commands::open(|_| Ok(Vec::new()), MAX_AGE, rate, &mut batch).unwrap();
    commands.merge_report("f", "other", Entry { by: "c".into(), ..entry(until, 0) }, until, &mut batch);
    commands
}

fn entry(sent: u64, number: u64) -> Entry {
    Entry { at: 5, sent, outcome: Outcome::Accepted, detail: String::new(), by: String::new(), number }
}

/// Returns a share's messages, with their topics.
fn said(share: &mut Share, has: bool, commands: &Commands, now: Duration) -> Vec<(String, Vec<u8>)> {
    let (node, mut said) = (share.node.clone(), Vec::new());
    share.say(now, BTreeMap::from([("f".to_owned(), has)]), commands, |below, message| {
        said.push((format!("{node}{below}"), message));
        true
    });
    said
}

#[test]
fn a_command_is_given_when_its_page_has_come_back_and_not_when_the_connection_is_another() {
    let (mut a, now) = (share("a"), milliseconds(1000));
    let command = |id: &str| Command { id: id.into(), order: serde_json::Map::new(), until: 9 };
    let accepted = |last: &str| {
        let known = |prefix: &str| {
            let known = [("x", 1), ("y", 2), ("z", 63)].into_iter().filter(|(known, _)| *known <= last);
            let value = |number| serde_json::to_string(&entry(4, number)).unwrap();
            let names = known.map(|(id, number)| (format!("command/f/{id}"), value(number)));
            Ok(if prefix == "command/" { names.collect() } else { Vec::new() })
        };
        let rate = Rate { per_second: 10.0, burst: 10 };
        Commands::open(known, MAX_AGE, rate, &mut Batch::default()).unwrap().0
    };
    let tell = |share: &mut Share, commands: &Commands, id: &str| {
        share.tell("f", id, commands.entry("f", id).unwrap(), Some((3, command(id))));
    };
    assert_eq!(a.connected(now, 100), []);
    let x = accepted("x");
    tell(&mut a, &x, "x");
    let first = said(&mut a, true, &x, now);
    let topics: Vec<&str> = first.iter().map(|(topic, _)| topic.as_str()).collect();
    assert_eq!(
        (topics, a.lease.holds_at(now)),
        (vec!["a/store-a/last", "a"], false),
        "the page, and that it runs"
    );
    // The broker returns it to the next process, or to this one on the next connection: that is not its way back.
    assert_eq!(a.receive(&first[0].0, &first[0].1, true, now), None);
    let back = ShareEvent::Back { give: vec![(3, command("x"))], lost: vec![] };
    assert_eq!(a.receive(&first[0].0, &first[0].1, false, now), Some(back));
    assert!(a.lease.holds_at(now + LEASE - STEP) && !a.lease.holds_at(now + LEASE));
    assert_eq!(a.receive(&first[0].0, &first[0].1, false, now), None, "once");
    // The other bridge learns the giver of the command from the stored page or from the message.
    for is_stored in [false, true] {
        let mut b = share("b");
        b.connected(now, 100);
        assert!(
            b.unread()
                .unwrap()
                .starts_with("the ids that a has executed are not all known: start that bridge")
        );
        let by = |told: &CommandReport| CommandReport {
            entry: Entry { by: "a".into(), ..told.entry.clone() },
            ..told.clone()
        };
        let heard = ShareEvent::Commands(x.page(0).iter().map(by).collect());
        assert_eq!(b.receive(&first[0].0, &first[0].1, is_stored, now), Some(heard));
        assert_eq!(b.unread(), None);
    }

    // A page does not come back, and a later message does.
    let (y, z) = (accepted("y"), accepted("z"));
    tell(&mut a, &y, "y");
    let second = said(&mut a, true, &y, now + 2 * STEP);
    tell(&mut a, &z, "z");
    let third = said(&mut a, true, &z, now + 2 * STEP);
    // The first page is full: it has another topic now.
    let topics: Vec<&str> = second.iter().chain(&third).map(|(topic, _)| topic.as_str()).collect();
    assert_eq!(topics, ["a/store-a/last", "a/store-a/0", "a/store-a/last"]);
    let back = ShareEvent::Back { give: vec![(3, command("z"))], lost: vec![(3, command("y"))] };
    assert_eq!(a.receive(&third[0].0, &third[0].1, false, now + 2 * STEP), Some(back));

    tell(&mut a, &z, "z");
    let messages = said(&mut a, true, &z, now + STEP);
    a.opened();
    assert_eq!(a.connected(now + STEP, 100), [(3, command("z"))]);
    assert_eq!(
        a.receive(&messages[0].0, &messages[0].1, false, now + STEP),
        None,
        "of an earlier connection"
    );
}

#[test]
fn who_has_not_heard_a_bridge_knows_nothing_of_commands_before() {
    let (mut a, mut b) = (share("a"), share("b"));
    let exchange = |from: &mut Share, to: &mut Share, has, until, now| {
        for (topic, message) in said(from, has, &commands(until), now) {
            from.receive(&topic, &message, false, now);
            assert!(!matches!(to.receive(&topic, &message, false, now), Some(ShareEvent::Malformed(_))));
        }
    };
    let start = milliseconds(1000);
    a.connected(start, 500_000);
    b.connected(start, 500_000);
    exchange(&mut a, &mut b, false, 0, start);
    assert_eq!((a.may_take("f", start), b.may_take("f", start)), (None, None));
    // No other bridge was heard: after a while this one is alone, and commands that another may have received are barred:
    // those dated ahead of a clock that is fast.
    let mut now = start;
    while a.may_take("f", now).is_none() {
        now += milliseconds(500);
        exchange(&mut a, &mut share("b"), false, 0, now);
    }
    assert_eq!((now - start, a.may_take("f", now)), (SILENT, Some(560_000)));
    // The broker has its ledger.
    let mut earlier = share("b");
    earlier.connected(now, 500_000);
    let ledger = said(&mut earlier, false, &commands(430_000), now).remove(0);
    a.receive(&ledger.0, &ledger.1, true, now);
    assert_eq!((a.unread(), a.may_take("f", now)), (None, Some(430_000)));
    // Another bridge was heard, with the latest command that it knows. This one may take the cell until the other has heard
    // it.
    let mut now = now + milliseconds(500);
    exchange(&mut b, &mut a, false, 450_000, now);
    assert_eq!(a.may_take("f", now), None);
    exchange(&mut b, &mut a, true, 455_000, now);
    assert_eq!((a.may_take("f", now), a.owner("f", now)), (None, Some("b")));
    now += milliseconds(1500);
    exchange(&mut a, &mut b, false, 0, now);
    assert!(b.must_give("f", now) && !a.must_give("f", now));
    exchange(&mut b, &mut a, false, 460_000, now);
    assert_eq!((a.may_take("f", now), b.may_take("f", now)), (Some(450_000), None));
}

#[test]
fn a_ledger_that_was_not_read_is_requested_and_published_again() {
    let (mut a, mut b, now) = (share("a"), share("b"), milliseconds(1000));
    a.connected(now, 500_000);
    b.connected(now, 500_000);
    let pages = |said: &[(String, Vec<u8>)]| said.iter().filter(|(topic, _)| topic.contains('/')).count();
    // The page of b is lost.
    let from_b = said(&mut b, false, &commands(0), now);
    assert_eq!((pages(&from_b), from_b.len()), (1, 2));
    a.receive(&from_b[1].0, &from_b[1].1, false, now);
    let from_a = said(&mut a, false, &commands(0), now);
    let later = now + Duration::from_secs(5);
    for (now, count) in [(now, 0), (later, 1), (later, 0)] {
        from_a.iter().for_each(|(topic, message)| drop(b.receive(topic, message, false, now)));
        let again = said(&mut b, false, &commands(0), now);
        assert_eq!(pages(&again), count, "{now:?}");
        again.iter().for_each(|(topic, message)| drop(a.receive(topic, message, false, now)));
    }
    assert_eq!(a.unread(), None);
}

#[test]
fn the_ledger_of_a_bridge_that_is_dead_is_the_same_after_a_short_time_without_a_connection() {
    let mut is_read = Vec::new();
    for (dead, away) in [(true, SILENT - STEP), (true, SILENT), (false, STEP)] {
        let (mut a, mut b, mut now) = (share("a"), share("b"), milliseconds(1000));
        a.connected(now, 500_000);
        b.connected(now, 500_000);
        for (topic, message) in said(&mut b, false, &commands(0), now) {
            a.receive(&topic, &message, false, now);
        }
        let end = if dead { now + SILENT } else { now + STEP };
        while now < end {
            now += STEP;
            for (topic, message) in said(&mut a, false, &commands(0), now) {
                a.receive(&topic, &message, false, now);
            }
        }
        assert_eq!(a.unread(), None);
        a.opened();
        a.connected(now + away, 500_000);
        is_read.push(a.unread().is_none());
    }
    assert_eq!(is_read, [true, false, false]);
}
