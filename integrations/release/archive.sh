#!/bin/bash
# Makes an archive of the program for a release: hankel-VERSION-TARGET.tar.gz with a folder of that name, and its
# line in SHA256SUMS. `cargo binstall` finds the program in it by `[package.metadata.binstall]` of cli/Cargo.toml.
#
#   integrations/release/archive.sh TARGET [OUT]
#
# TARGET is what rustc calls the machine (x86_64-unknown-linux-gnu); `rustup target add TARGET` installs it. For a
# musl target, CC_TARGET and CXX_TARGET (with _ for -) name compilers that link with musl: a part of Hankel is C++,
# and musl-gcc alone has no C++ library. OUT is a folder [release]; archives of other targets stay in it.
#
#   HANKEL_BINARY      a program that is already built: nothing is compiled
#   SOURCE_DATE_EPOCH  time of the files in the archive [0]: the same program gives the same archive
set -euo pipefail
if [ $# -lt 1 ] || [ $# -gt 2 ] || [ -z "$1" ]; then
    echo "usage: $0 TARGET [OUT]" >&2
    exit 2
fi
target=$1
out=${2:-release}
case $target in *[!A-Za-z0-9_.-]* | [!a-z]*)
    echo "$0: \`$target\` is not a target: \`rustc --print target-list\` shows all" >&2
    exit 2
    ;;
esac
root=$(cd "$(dirname "${BASH_SOURCE[0]}")/../.." && pwd)
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"$/\1/p' "$root/Cargo.toml")
suffix=
case $target in *windows*) suffix=.exe ;; esac

binary=${HANKEL_BINARY:-}
if [ -z "$binary" ]; then
    case $target in *musl*)
        compiler=CXX_${target//-/_}
        if ! command -v "${!compiler:-}" >/dev/null; then
            echo "$0: set $compiler to a C++ compiler that links with musl" >&2
            exit 3
        fi
        ;;
    esac
    # As .cargo/config.toml has it, which cargo reads in that folder alone.
    export CXXFLAGS="${CXXFLAGS:--USPIRV_CHECK_CONTEXT}"
    cargo build --release --locked --manifest-path "$root/Cargo.toml" -p hankel --target "$target"
    binary=${CARGO_TARGET_DIR:-$root/target}/$target/release/hankel$suffix
fi
if [ ! -f "$binary" ]; then
    echo "$0: $binary: there is no such file" >&2
    exit 2
fi

name=hankel-$version-$target
mkdir -p "$out"
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir "$folder/$name"
install -m 755 "$binary" "$folder/$name/hankel$suffix"
install -m 644 "$root/README.md" "$root/LICENSE-MIT" "$root/LICENSE-APACHE" "$folder/$name"
tar --create --directory "$folder" --sort=name --owner=0 --group=0 --numeric-owner \
    --mtime="@${SOURCE_DATE_EPOCH:-0}" --format=gnu "$name" | gzip -9n >"$folder/archive"
mv "$folder/archive" "$out/$name.tar.gz"
# One line for each archive, whatever was there before.
(cd "$out" && sha256sum -- hankel-*.tar.gz >SHA256SUMS)
echo "$out/$name.tar.gz"
