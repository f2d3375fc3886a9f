#!/bin/bash -eu
export CARGO_TARGET_DIR=$PWD/target
cargo fuzz build -O
cp -r reference "$OUT/reference"
for target in $(cargo fuzz list); do
    cp "$CARGO_TARGET_DIR/x86_64-unknown-linux-gnu/release/$target" "$OUT/"
    mkdir -p "fuzz/corpus/$target"
    "$OUT/$target" -runs=0 "fuzz/corpus/$target" # writes its seeds there
    zip -jq "$OUT/${target}_seed_corpus.zip" "fuzz/corpus/$target"/*
done
