use testkit::contract;
use val2_viewer::Decoder;

pub fn decoder() {
    contract::decoder("val2-viewer", Decoder::new, &super::frames("val2-viewer", None), 1);
}
