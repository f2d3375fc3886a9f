use kawasaki_msg::{Charset, Decoder};
use testkit::contract;

const LINK: &str = "kawasaki-msg";

pub fn decoder() {
    // Without its '>', a message ends where its length or the next '<' says.
    contract::decoder(LINK, || Decoder::new(Charset::Ascii), &super::frames(LINK, None), 1);
}
