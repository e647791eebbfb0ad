#!/usr/bin/env bash
# "Costs nothing when unused", checked on the instructions: the traversal with NoProbe must compile to the same code as a
# traversal that never had the parameter. That twin is made here, by taking every mention of the probe out of
# crates/hotspot-bvh/src/traverse.rs; both are compiled by the same command and compared function by function.
#
# Compared are the kernels for trees without instances, AVX2 and portable. (Where a tree has instances, the call that
# searches one passes an address of the zero-sized probe: one instruction per instance entered.)
#
# Exit code 1 and a difference when they are not the same; 2 when the twin could not be made.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
target=${CARGO_TARGET_DIR:-$root/target}/noprobe
mkdir -p "$target"

# A small workspace that holds the two crates as they are (with), or with the parameter taken out (without).
workspace() {
    local to=$target/$1
    rm -rf "$to"
    mkdir -p "$to/crates"
    cp -r "$root/crates/hotspot-bvh" "$root/crates/hotspot-probe" "$to/crates/"
    cp "$root/Cargo.lock" "$to/"
    sed -e 's/^members = .*/members = ["crates\/hotspot-bvh", "crates\/hotspot-probe"]/' \
        -e '/^hotspot-\(scene\|cost\|integrator\) = /d' \
        -e '/^\[profile\..*\.package\.hotspot-\(benches\|cost\|integrator\)\]/,/^$/d' "$root/Cargo.toml" >"$to/Cargo.toml"
}

# Assembly of the example, one function per line: name, then instructions; local labels without their function's number,
# hashes and addresses of constants blanked.
assembly() {
    (cd "$target/$1" && RUSTFLAGS=-Awarnings cargo rustc -q --release --offline -p hotspot-bvh --example noprobe_kernels \
        --target-dir "$target/build-$1" -- --emit asm -C debuginfo=0 -C codegen-units=1 -C lto=off)
    local file
    file=$(ls -t "$target/build-$1"/release/examples/noprobe_kernels-*.s | head -n 1)
    sed -E -e 's/17h[0-9a-f]{16}E/E/g' -e 's/\.L(BB|CPI|JTI|tmp|func_end)[0-9]+/.L\1/g' \
        -e 's/\.L(anon|__unnamed|alloc)[A-Za-z0-9_.]*/.L\1/g' "$file" |
        awk '/^[A-Za-z_][^ ]*:$/ { name = $1; body = ""; open = 1; next }
             /^\t\.cfi_endproc/ { if (open && name ~ /hotspot_bvh|noprobe_kernels/) print name body; open = 0 }
             open && !/^\t\.(cfi|p2align|file|loc|size|type|section|globl|hidden)/ { gsub(/[ \t]+/, " "); body = body " ;" $0 }' |
        sort
}

workspace with
workspace without
traverse=$target/without/crates/hotspot-bvh/src/traverse.rs
sed -i -E \
    -e '/^ *if P::ON \{$/,/^ *\}$/d' \
    -e '/^ *probe\.finish\(.*\);$/d' \
    -e '/^ *(mut )?probe: (&mut )?P,$/d' \
    -e 's/, P: RayProbe//; s/<P: RayProbe, /</' \
    -e 's/::<S, P, /::<S, /g' \
    -e 's/, (&mut )?probe\)/)/g' \
    -e 's/(counts\(filter, instance, primitive, frame, &triangle)\)/\1, \&mut NoProbe)/' \
    -e 's/^use hotspot_probe::RayProbe;/use hotspot_probe::NoProbe;/' "$traverse"
sed -i -E -e 's/traverse::(closest|any)::<S, P, /traverse::\1::<S, /; s/(traverse::.*), probe\)/\1)/' \
    "$target/without/crates/hotspot-bvh/src/lib.rs"
sed -i -E -e 's/_of_frame::<S, NoProbe, /_of_frame::<S, /; /^ *&mut NoProbe,$/d; s/, &mut NoProbe\)/)/; /^use hotspot_probe::NoProbe;$/d' \
    "$target/without/crates/hotspot-bvh/src/packet.rs"
sed -i -E -e "s/_of_frame::<S, P::Ray<'_>, /_of_frame::<S, /; /^ *&mut probe,$/d; s/, &mut probe\)/)/" \
    "$target/without/crates/hotspot-bvh/src/lanes.rs"
if grep -nE '(^|[^_])probe[.,:)]|\bP\b' "$traverse"; then
    echo "the probe is still in the twin: teach $0 the lines above" >&2
    exit 2
fi
assembly with >"$target/with.txt"
assembly without >"$target/without.txt"
functions=$(wc -l <"$target/with.txt")
instructions=$(tr ';' '\n' <"$target/with.txt" | grep -c '^ *[a-z]' || true)
if [ "$functions" -lt 4 ] || [ "$instructions" -lt 1000 ]; then
    echo "only $functions functions with $instructions instructions were found: nothing is compared" >&2
    exit 2
fi
if ! diff <(tr ';' '\n' <"$target/without.txt") <(tr ';' '\n' <"$target/with.txt") >"$target/diff.txt"; then
    head -n 40 "$target/diff.txt"
    echo "the traversal with NoProbe differs from one without the parameter" >&2
    exit 1
fi
echo "NoProbe: $functions functions, $instructions instructions, the same as without the parameter"
