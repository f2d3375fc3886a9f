//! The workstation whose request is lost, on a virtual clock.

use core::time::Duration;

use cellwire_sim::{Fault, Script, Settings as _, Viewer};
use val2_viewer::{Host, HostConfig};

const S: Duration = Duration::from_secs(1);

#[test]
fn a_lost_request_and_a_lost_pose_do_not_stop_the_picture() {
    let mut bench = Viewer::default().bench(Host::new(HostConfig::default()).unwrap()).unwrap();
    bench.wire.baud = Some(9600);
    bench.faults().follow(Script::new().answer(50, Fault::Drop).request(100, Fault::Drop));
    for tick in 0..6000u64 {
        let now = bench.now();
        bench.session_mut().set_pose(now, [i16::try_from(tick).unwrap(); 12]);
        bench.run_for(S / 50);
    }
    let drawn = bench.device().drawn();
    assert!(drawn.poses > 500 && drawn.gaps == 1 && drawn.most_at_once == 1, "{drawn:?}");
    let last = bench.executed().last().unwrap();
    assert!(last.at > 119 * S && last.work.pose[0] > 5900, "{last:?}");
    let gaps = bench.executed().windows(2).map(|two| two[1].at - two[0].at);
    assert!(gaps.into_iter().all(|gap| gap < 5 * S), "the picture was frozen");
    assert_eq!(bench.faults().happened().len(), 2);
}
