#!/usr/bin/env bash
# The regression gate: instructions of the kernels by callgrind, against those recorded in instructions.tsv.
#
#   benches/gates/instructions.sh            compares: exit code 1 where a kernel takes over 2 % more (or less: record it)
#   benches/gates/instructions.sh --record   writes instructions.tsv
#
# Counts repeat within about 0.1 % and do not depend on what else the machine does; they do depend on the compiler. Where
# rustc is not the one that they were recorded with, differences are printed and nothing fails: record them anew in a
# commit of its own. Needs valgrind; without AVX2 the kernels for it fall back to the portable ones, and are not compared.
set -euo pipefail
root=$(cd "$(dirname "$0")/../.." && pwd)
table=$root/benches/gates/instructions.tsv
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
cd "$root"
# With the renderer, whose features its dependencies have then, so that what that is made of is not compiled again.
cargo build -q --locked --profile bench -p hotspot-benches -p hotspot-render --bin kernels
kernels=${CARGO_TARGET_DIR:-target}/release/kernels
for kernel in $("$kernels"); do
    said=$(valgrind --tool=callgrind --callgrind-out-file="$work/out" --toggle-collect='kernels::measured*' \
        "$kernels" "$kernel" 2>"$work/log") || {
        # The compiler's choice of instructions is no fault of ours; what is not counted is said, and recorded as unknown.
        grep -q "unhandled instruction bytes" "$work/log" || { cat "$work/log" >&2; exit 1; }
        printf '%s\t0\tunknown\n' "$kernel"
        continue
    }
    printf '%s\t%s\t%s\n' "$kernel" "${said##* }" "$(awk '/^summary:/ { print $2 }' "$work/out")"
done >"$work/counts"
compiler=$(rustc --version)
if [ "${1:-}" = --record ]; then
    { printf '# %s\n# kernel\trays or paths\tinstructions\n' "$compiler"; cat "$work/counts"; } >"$table"
    cat "$table"
    exit
fi
recorded=$(sed -n '1s/^# //p' "$table")
grep -q avx2 /proc/cpuinfo && avx2=1 || avx2=0
awk -F'\t' -v avx2=$avx2 '
    NR == FNR { if (!/^#/) was[$1] = $3; next }
    { seen[$1] = 1
      if ($3 == "unknown" || was[$1] == "unknown") { printf "%-44s not compared: this valgrind lacks an instruction of it\n", $1; next }
      if (!($1 in was)) { printf "%-44s %8.0f each  not recorded\n", $1, $3 / $2; bad = 1; next }
      change = 100 * ($3 / was[$1] - 1)
      skip = !avx2 && $1 !~ /portable/
      verdict = skip ? "not compared: no AVX2 here" : (change > 2 || change < -2 ? "BEYOND 2 %" : "")
      if (verdict ~ /BEYOND/) bad = 1
      printf "%-44s %8.0f each  %+6.2f %%  %s\n", $1, $3 / $2, change, verdict }
    END { for (k in was) if (!(k in seen)) { print k " is recorded and was not run"; bad = 1 }
          exit bad }' "$table" "$work/counts" && verdict=0 || verdict=1
if [ $verdict = 1 ] && [ "$recorded" != "$compiler" ]; then
    echo "recorded with $recorded, here $compiler: not a failure; benches/gates/instructions.sh --record brings them up to date"
    exit 0
fi
[ $verdict = 0 ] || echo "if it is meant, record it: benches/gates/instructions.sh --record" >&2
exit $verdict
