#!/bin/bash -eu
export CARGO_TARGET_DIR=$PWD/target
cd fuzz
cargo fuzz build -O
for source in fuzz_targets/*.rs; do
    target=$(basename "$source" .rs)
    cp "$CARGO_TARGET_DIR/x86_64-unknown-linux-gnu/release/$target" "$OUT/"
    zip -jq "$OUT/${target}_seed_corpus.zip" "corpus/$target"/*
done
