#!/usr/bin/env bash
# Compiles the Embree 4 side of the traversal benchmark into target/embree/driver.
#
# Needs a C++ compiler and Embree 4's shared library: EMBREE=/path/to/libembree4.so; or the system's; or, when there is
# neither, the one inside the Python wheel `embreex` (pip, x86-64), which is unpacked below target/. (Debian 12's
# libembree-dev is Embree 3, whose interface differs.)
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
out=${CARGO_TARGET_DIR:-$here/../../target}/embree
mkdir -p "$out"
if [ -z "${EMBREE:-}" ]; then
    EMBREE=$(ldconfig -p 2>/dev/null | awk '/libembree4\.so/ { print $NF; exit }')
fi
if [ -z "$EMBREE" ]; then
    python3 -m pip download --quiet --no-deps --dest "$out" embreex==4.4.0.post1
    python3 -m zipfile -e "$out"/embreex-*.whl "$out"
    EMBREE=$(ls "$out"/embreex.libs/libembree4*.so* | head -n 1)
fi
${CXX:-c++} -O3 -std=c++17 -march=native "$here/driver.cpp" -o "$out/driver" "$EMBREE" -Wl,-rpath,"$(cd "$(dirname "$EMBREE")" && pwd)"
echo "$out/driver: built against $EMBREE"
