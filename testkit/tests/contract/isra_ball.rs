use isra_ball::Decoder;
use testkit::contract;

pub fn decoder() {
    // Values that look like a header take the next packet with them.
    contract::decoder("isra-ball", Decoder::new, &super::frames("isra-ball", None), 1);
}
