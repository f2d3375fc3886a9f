use mmacell_proto::{Decoder, Dialect};
use testkit::contract;

const LINK: &str = "mmacell-proto";

pub fn decoder() {
    // A corrupt line end makes one line of two.
    contract::decoder(LINK, || Decoder::new(Dialect::STRICT), &super::frames(LINK, None), 1);
}
