#!/bin/bash -eu
export CARGO_TARGET_DIR=$PWD/target
cargo run -p cellwire-fuzz -- "$CARGO_TARGET_DIR/seeds"
cp -r reference "$OUT/reference"
cd fuzz
cargo fuzz build -O
for seeds in "$CARGO_TARGET_DIR"/seeds/*; do
    target=${seeds##*/}
    cp "$CARGO_TARGET_DIR/x86_64-unknown-linux-gnu/release/fuzz" "$OUT/$target"
    find "$seeds" "corpus/$target" -type f 2>/dev/null | zip -jq "$OUT/${target}_seed_corpus.zip" -@
done
