//! The times of every machine, as `robot_session::end::Machine` requires, and the sizes of the machines.
#![allow(missing_docs)]

#[test]
fn every_machine_keeps_its_times_and_its_size() {
    for table in testkit::links::TABLES.iter().copied().flatten() {
        println!("{}", table.link);
        (table.check)(table);
    }
}
