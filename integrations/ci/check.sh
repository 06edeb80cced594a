#!/bin/bash
# What the GitHub Action runs, and what any other CI can run as it is: compares the committed shaders
# with their sources, runs the matrix if it is asked for, and writes both reports to a folder and to
# the job's summary. Fails, after both, if either failed.
#
#   HANKEL                the program [hankel]
#   HANKEL_FOLDER         the committed folder [shaders]
#   HANKEL_MANIFEST_PATH  Cargo.toml of the kernel crate [the built-in kernels]
#   HANKEL_BUDGET         limits of the kernels' cost [hankel.toml, if there is one]
#   HANKEL_OPTIONS        the options that the folder was built with
#   HANKEL_MATRIX         "true" runs the matrix too
#   HANKEL_MATRIX_OPTIONS further options of `hankel parity --matrix`, as `--require msl`
#   HANKEL_REPORT         folder for the reports [hankel-report]
#   GITHUB_STEP_SUMMARY   file that the summary is added to
set -u
hankel=${HANKEL:-hankel}
folder=${HANKEL_FOLDER:-shaders}
report=${HANKEL_REPORT:-hankel-report}
summary=${GITHUB_STEP_SUMMARY:-/dev/null}
source=()
if [ -n "${HANKEL_MANIFEST_PATH:-}" ]; then source=(--manifest-path "$HANKEL_MANIFEST_PATH"); fi
budget=()
if [ -n "${HANKEL_BUDGET:-}" ]; then budget=(--budget "$HANKEL_BUDGET"); fi
# Options may be on several lines. `read` ends with an error at the end of its input.
read -r -d '' -a options <<<"${HANKEL_OPTIONS:-}" || true
mkdir -p "$report" || exit 3

# With `set -u`, bash before 4.4 takes an empty array for one that is not set.
"$hankel" check "$folder" ${source[@]+"${source[@]}"} ${budget[@]+"${budget[@]}"} \
    ${options[@]+"${options[@]}"} 2>&1 | tee "$report/check.txt"
checked=${PIPESTATUS[0]}
{
    if [ "$checked" = 0 ]; then echo "### Shaders: as their sources say"; else echo "### Shaders: \`hankel check\` failed"; fi
    echo '```text'
    # A summary holds 1 MiB at most; the whole text is in the artifact.
    head -c 100000 "$report/check.txt"
    echo '```'
} >>"$summary"

compared=0
if [ "${HANKEL_MATRIX:-false}" = true ]; then
    read -r -d '' -a chosen <<<"${HANKEL_MATRIX_OPTIONS:-}" || true
    "$hankel" parity --matrix ${source[@]+"${source[@]}"} ${chosen[@]+"${chosen[@]}"} --html "$report/matrix.html" \
        --json "$report/matrix.json" --markdown "$report/matrix.md"
    compared=$?
    {
        if [ "$compared" = 0 ]; then echo "### Matrix: all backends agree"; else echo "### Matrix: failed"; fi
        if [ -s "$report/matrix.md" ]; then cat "$report/matrix.md"; fi
    } >>"$summary"
fi
if [ "$checked" != 0 ]; then exit "$checked"; fi
exit "$compared"
