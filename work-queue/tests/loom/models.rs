//! Jobs are published, executed and discarded.

use super::*;

fn publish_and_release(capacity: usize, count: u16) {
    model_of_with((capacity > 1).then_some(3), capacity, move |jobs, mut writer, mut reader| {
        let reader = thread::spawn(move || {
            for number in 1..=count {
                assert_eq!(execute_next(&mut reader), number);
            }
            assert_eq!(execute(&mut reader), None);
        });
        for _ in 0..count {
            queue_next(&mut writer, jobs);
        }
        reader.join().unwrap();
        assert_eq!(writer.free(), capacity);
    });
}

#[test]
fn publish_and_release_capacity_1() {
    publish_and_release(1, 3);
}

#[test]
fn publish_and_release_capacity_2() {
    publish_and_release(2, 4);
}

#[test]
fn publish_and_release_capacity_3() {
    publish_and_release(3, 4);
}

/// The writer finds the queue full, and fills again at the low-water mark.
#[test]
fn full_then_low_water() {
    model_of(2, |jobs, mut writer, mut reader| {
        queue_next(&mut writer, jobs);
        queue_next(&mut writer, jobs);
        let world = World::new();
        let robot = world.clone();
        let reader = thread::spawn(move || {
            for _ in 0..2 {
                let job = reader.take().unwrap();
                robot.act(job.value);
                job.complete();
            }
            reader
        });
        while !writer.drained(0) {
            thread::yield_now();
        }
        assert_eq!(world.look(), [1, 2], "a drained queue means executed jobs");
        queue_next(&mut writer, jobs);
        assert_eq!(
            execute_all(&mut {
                drop(writer);
                reader.join().unwrap()
            }),
            [3]
        );
    });
}

/// Explores a queue in which the second job overtakes the first; its slot is filled again only after that of the first.
fn out_of_order(capacity: usize, count: u16) {
    model_of_with((capacity > 2).then_some(3), capacity, move |jobs, mut writer, mut reader| {
        let reader = thread::spawn(move || {
            let mut numbers = Vec::new();
            while numbers.len() < count.into() {
                let job = match reader.take_where(|number, _| number % 2 == 0) {
                    Some(job) => Some(job),
                    None => reader.take(),
                };
                match job {
                    Some(job) => {
                        assert_eq!((job.value, job.copy), (job.number(), job.number()));
                        numbers.push(job.complete().value);
                    }
                    None => thread::yield_now(),
                }
            }
            assert!(reader.is_empty());
            numbers.sort_unstable();
            assert!(numbers.into_iter().eq(1..=count), "each job once");
        });
        for _ in 0..count {
            queue_next(&mut writer, jobs);
        }
        reader.join().unwrap();
        assert_eq!(writer.free(), capacity);
    });
}

#[test]
fn out_of_order_capacity_2() {
    out_of_order(2, 3);
}

#[test]
fn out_of_order_capacity_3() {
    out_of_order(3, 4);
}

/// Explores two jobs, a reset, a third job: the reset comes before, during and after the execution of each of the first two.
fn abort(capacity: usize) {
    model_of(capacity, move |jobs, mut writer, mut reader| {
        let world = World::new();
        let robot = world.clone();
        let reader = thread::spawn(move || {
            let mut numbers = Vec::new();
            loop {
                let last_look = reader.is_abandoned();
                match reader.take() {
                    Some(job) => {
                        robot.act(job.value);
                        thread::yield_now(); // the reset during execution
                        assert_eq!((job.value, job.copy), (job.number(), job.number()), "pulled away");
                        numbers.push(job.complete().value);
                    }
                    None if last_look => return numbers,
                    None => thread::yield_now(),
                }
            }
        });
        queue_next(&mut writer, jobs);
        if capacity > 1 {
            queue_next(&mut writer, jobs);
        }
        let after = writer.next_number();
        writer.clear();
        while !writer.is_settled() {
            thread::yield_now();
        }
        let executed = world.look(); // nothing from before runs any more: loom would see it
        assert_eq!(writer.free(), capacity);
        queue_next(&mut writer, jobs);
        drop(writer);
        let mut numbers = reader.join().unwrap();
        assert_eq!(numbers.pop(), Some(after), "a job queued after the reset is kept");
        assert_eq!(numbers, executed, "nothing from before the reset starts after it has settled");
        assert!((1..).zip(&numbers).all(|(expected, number)| expected == *number), "in order");
    });
}

#[test]
fn abort_capacity_1() {
    abort(1);
}

#[test]
fn abort_capacity_2() {
    abort(2);
}

/// A job queued after the reset, without waiting for it to settle: kept, and nothing older starts after it.
#[test]
fn queued_behind_a_reset() {
    model_of(3, |jobs, mut writer, mut reader| {
        let reader = thread::spawn(move || execute_all(&mut reader));
        queue_next(&mut writer, jobs);
        queue_next(&mut writer, jobs);
        writer.reset();
        writer.claim().unwrap().commit_with(1, || jobs.job(1)).unwrap();
        drop(writer);
        let numbers = reader.join().unwrap();
        assert!([&[1][..], &[1, 1], &[1, 2, 1]].contains(&&*numbers), "{numbers:?}");
    });
}

/// Explores two jobs, a reset, a third job: a reader that has seen the third looks for a job.
fn look_after_a_reset(look: fn(&mut Reader<'_, Job>) -> Option<u16>) {
    model_of(3, move |jobs, mut writer, mut reader| {
        let reader = thread::spawn(move || {
            while !reader.iter().any(|(number, _)| number == 3) {
                thread::yield_now();
            }
            assert_eq!(look(&mut reader), Some(3), "what a reset has discarded is not executed");
        });
        queue_next(&mut writer, jobs);
        queue_next(&mut writer, jobs);
        writer.clear();
        queue_next(&mut writer, jobs);
        reader.join().unwrap();
        assert!(writer.is_settled(), "a look lets a reset settle");
        assert_eq!(writer.free(), 3);
    });
}

#[test]
fn take_after_a_reset() {
    look_after_a_reset(execute);
}

#[test]
fn batch_after_a_reset() {
    look_after_a_reset(|reader| {
        let mut batch = reader.take_batch(1)?;
        let number = batch.iter_mut().next().map(|(number, _)| number);
        batch.complete();
        number
    });
}

#[test]
fn find_after_a_reset() {
    look_after_a_reset(|reader| {
        let job = reader.take_where(|_, _| true)?;
        Some(job.complete().value)
    });
}

/// A job completed out of order and a reset: the discarded one before it is not discarded twice, nor the overtaker at all.
#[test]
fn out_of_order_across_a_reset() {
    model_of_with(Some(3), 3, |jobs, mut writer, mut reader| {
        queue_next(&mut writer, jobs);
        queue_next(&mut writer, jobs);
        let reader = thread::spawn(move || {
            let mut numbers = Vec::new();
            if let Some(job) = reader.take_where(|number, _| number == 2) {
                numbers.push(job.complete().value);
            }
            if let Some(job) = reader.take_where(|number, _| number == 3) {
                numbers.push(job.complete().value);
            }
            numbers.extend(execute_all(&mut reader));
            numbers
        });
        writer.clear();
        queue_next(&mut writer, jobs);
        queue_next(&mut writer, jobs);
        drop(writer);
        let numbers = reader.join().unwrap();
        assert_eq!(numbers.iter().filter(|&&number| number > 2).count(), 2, "{numbers:?}");
        assert!(numbers.iter().all(|number| numbers.iter().filter(|n| *n == number).count() == 1));
    });
}

/// Two resets, one after the other.
#[test]
fn two_resets() {
    model_of(2, |jobs, mut writer, mut reader| {
        let reader = thread::spawn(move || execute_all(&mut reader));
        queue_next(&mut writer, jobs);
        writer.clear();
        queue_next(&mut writer, jobs);
        writer.clear();
        drop(writer);
        let numbers = reader.join().unwrap();
        assert!([&[][..], &[1], &[2], &[1, 2]].contains(&&*numbers), "{numbers:?}");
    });
}

/// Batches on both sides, a reset in the middle of one: jobs published before it are executed or discarded, in
/// sequence; jobs published afterwards are kept; each job has its number.
fn batches_and_a_reset(reset: fn(&mut Writer<'_, Job>), next: u16) {
    model_of(3, move |jobs, mut writer, mut reader| {
        let reader = thread::spawn(move || {
            let mut numbers = Vec::new();
            loop {
                let last_look = reader.is_abandoned();
                match reader.take_batch(2) {
                    Some(mut batch) => {
                        for (number, job) in batch.iter_mut() {
                            assert_eq!((job.value, job.copy), (number, number), "torn, or of another number");
                            job.copy = 0; // nobody else has it
                            numbers.push(number);
                        }
                        batch.complete();
                    }
                    None if last_look => return numbers,
                    None => thread::yield_now(),
                }
            }
        });
        let mut batch = writer.claim_batch(2).unwrap();
        batch.claim().unwrap().commit_with(1, || jobs.job(1)).unwrap();
        batch.fill([jobs.job(2)]);
        assert_eq!(batch.publish(), 2);
        reset(&mut writer);
        assert_eq!(writer.next_number(), next);
        for publish in [false, true] {
            let mut batch = writer.claim_batch(1).unwrap();
            batch.fill([jobs.job(next)]);
            if publish {
                assert_eq!(batch.publish(), 1);
            }
        }
        drop(writer);
        let mut numbers = reader.join().unwrap();
        assert_eq!(numbers.pop(), Some(next), "a job queued after the reset is kept");
        assert!([&[][..], &[1], &[1, 2]].contains(&&*numbers), "{numbers:?}");
    });
}

#[test]
fn batches_and_a_clear() {
    batches_and_a_reset(|writer| writer.clear(), 3);
}

#[test]
fn batches_and_a_restart_of_the_numbers() {
    batches_and_a_reset(|writer| writer.reset(), 1);
}

/// A reset that the reader may never see is followed by another one: the numbers still are those of the jobs.
#[test]
fn numbers_after_two_resets() {
    model_of(3, |jobs, mut writer, mut reader| {
        let reader = thread::spawn(move || execute_all(&mut reader));
        queue_next(&mut writer, jobs);
        writer.reset();
        queue_next(&mut writer, jobs);
        writer.clear();
        queue_next(&mut writer, jobs);
        drop(writer);
        let numbers = reader.join().unwrap();
        assert!([&[2][..], &[1, 2], &[1, 1, 2]].contains(&&*numbers), "{numbers:?}");
    });
}
