#!/bin/bash -eu
export CARGO_TARGET_DIR=$PWD/target
cd fuzz
for corpus in corpus/*; do
    target=${corpus##*/}
    FUZZ=$target cargo fuzz build -O
    cp "$CARGO_TARGET_DIR/x86_64-unknown-linux-gnu/release/fuzz" "$OUT/$target"
    zip -jq "$OUT/${target}_seed_corpus.zip" "$corpus"/*
done
