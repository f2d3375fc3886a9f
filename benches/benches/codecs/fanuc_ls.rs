use std::hint::black_box;

use criterion::Criterion;
use fanuc_ls::{Program, Rules};

const TEXT: &str = include_str!("../../../reference/ls/figure-4.canonical.ls");

pub(crate) fn bench(criterion: &mut Criterion) {
    let program = Program::decode(TEXT).expect("the listing reads");
    let rules = Rules::default();
    let mut group = super::group(criterion, "fanuc-ls", TEXT.len());
    group.bench_function("decode the source's listing", |b| b.iter(|| Program::decode(black_box(TEXT))));
    group.bench_function("encode it", |b| b.iter(|| black_box(&program).to_text(&rules)));
}
