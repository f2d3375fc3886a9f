use laser_eb90::{Decoder, Profile};
use testkit::contract;

const LINK: &str = "laser-eb90";

pub fn decoder() {
    // A corrupt tail takes the next head with it: the frame ends where the next tail is.
    contract::decoder(LINK, || Decoder::new(&Profile::default()), &super::frames(LINK, None), 1);
}
