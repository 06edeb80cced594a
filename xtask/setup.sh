# Sourced by ./demo and ./check: installs what is missing, and says so. `for_tests=yes` asks for what
# only the tests need: the compilers, drivers and browsers of other people that the matrix runs on.
# `hankel doctor` lists them with their licences.

need() { # need COMMAND-OR-FILE PACKAGE
    command -v "$1" >/dev/null 2>&1 || [ -e "$1" ] || missing="$missing $2"
}

need_library() { # need_library FILE PACKAGE
    ldconfig -p 2>/dev/null | grep -q "$1" || missing="$missing $2"
}

# The first of the files that exists.
first() {
    for file in "$@"; do
        [ -e "$file" ] && printf '%s' "$file" && return
    done
}

# What a file of xtask/tools names is installed by its versions and checksums: a copy of it is the last thing that is
# written, so that what was interrupted, or is of another version, is installed again.
is_installed() { # is_installed FILE
    cmp -s "xtask/tools/$1" "$HANKEL_TOOLS/$1.installed"
}

installed() { # installed FILE
    cp "xtask/tools/$1" "$HANKEL_TOOLS/$1.installed"
}

missing=
need c++ g++
need_library libvulkan.so.1 libvulkan1
if [ -z "$(first /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json)" ]; then
    missing="$missing mesa-vulkan-drivers"
fi
if [ "${for_tests:-no}" = yes ]; then
    need glslangValidator glslang-tools
    need clang++-19 clang-19
    need chromium chromium
    need_library libEGL.so.1 libegl1
    need_library libGLESv2.so.2 libgles2
    need_library libEGL_mesa.so.0 libegl-mesa0
    need node nodejs
    need npm npm
    need ninja ninja-build
    need cmake cmake
    need pip3 python3-pip
fi

if [ -n "$missing" ]; then
    if command -v apt-get >/dev/null 2>&1; then
        as_root=
        [ "$(id -u)" = 0 ] || as_root=sudo
        echo "Installing$missing"
        $as_root apt-get update -qq
        # shellcheck disable=SC2086 # a list of words
        DEBIAN_FRONTEND=noninteractive $as_root apt-get install -y -qq --no-install-recommends $missing
    else
        echo "Please install, by the names that Debian gives them:$missing" >&2
        exit 3
    fi
fi

if ! command -v cargo >/dev/null 2>&1; then
    echo "Rust is missing: install a stable toolchain of 1.89 or later, with rustup or from your distribution" >&2
    exit 3
fi

# What no distribution has, in a folder of Hankel's own. Versions and checksums are in xtask/tools.
if [ "${for_tests:-no}" = yes ]; then
    HANKEL_TOOLS=${HANKEL_TOOLS:-${XDG_CACHE_HOME:-$HOME/.cache}/hankel/tools}
    export HANKEL_TOOLS
    mkdir -p "$HANKEL_TOOLS"
    if ! is_installed package-lock.json || [ ! -e "$HANKEL_TOOLS/node_modules/webgpu/package.json" ]; then
        echo "Installing Dawn for Node.js, three.js, TypeScript and WESL's linker (npm: webgpu, MIT and" \
            "BSD-3-Clause; three, @types/three and wesl, MIT; typescript, Apache-2.0)"
        cp xtask/tools/package.json xtask/tools/package-lock.json "$HANKEL_TOOLS"
        npm ci --silent --prefix "$HANKEL_TOOLS"
        installed package-lock.json
    fi
    if ! command -v dxc >/dev/null 2>&1 &&
        ! { is_installed requirements.txt && [ -e "$HANKEL_TOOLS/libdxcompiler_x86_64.so.3.7" ]; }; then
        echo "Installing DXC's library (PyPI: compushady, MIT; DXC: NCSA)"
        pip3 download --quiet --no-deps --no-binary :all: --dest "$HANKEL_TOOLS" \
            --require-hashes --requirement xtask/tools/requirements.txt
        tar -xzf "$HANKEL_TOOLS/compushady-0.17.5.tar.gz" -C "$HANKEL_TOOLS" --strip-components=3 \
            compushady-0.17.5/compushady/backends/libdxcompiler_x86_64.so.3.7
        tar -xzOf "$HANKEL_TOOLS/compushady-0.17.5.tar.gz" compushady-0.17.5/LICENSE \
            >"$HANKEL_TOOLS/compushady-LICENSE"
        installed requirements.txt
    fi
    slang=$HANKEL_TOOLS/slang
    if ! command -v slangc >/dev/null 2>&1 &&
        ! { is_installed wheels.txt && [ -x "$slang/slangtorch/bin/slangc" ]; }; then
        echo "Installing slangc (PyPI: slangtorch, Apache-2.0 with LLVM exceptions)"
        pip3 download --quiet --no-deps --only-binary :all: --platform manylinux_2_27_x86_64 \
            --python-version 3.11 --dest "$HANKEL_TOOLS" --require-hashes --requirement xtask/tools/wheels.txt
        python3 -m zipfile -e "$HANKEL_TOOLS/slangtorch-1.3.22-py3-none-manylinux_2_27_x86_64.whl" "$slang"
        chmod +x "$slang/slangtorch/bin/slangc"
        installed wheels.txt
    fi
    if ! is_installed crates.txt || [ ! -e "$HANKEL_TOOLS/bevy/bevy_render/LICENSE-MIT" ]; then
        echo "Fetching Bevy's shaders (crates.io: bevy_pbr, bevy_render 0.19.1, MIT or Apache-2.0)"
        while read -r sha256 crate; do
            # cargo downloads a crate to say what it is.
            (cd "$HANKEL_TOOLS" && cargo info --quiet "${crate%-*}@${crate##*-}" >/dev/null)
            archive=$(first "${CARGO_HOME:-$HOME/.cargo}"/registry/cache/*/"$crate.crate")
            echo "$sha256  $archive" | sha256sum --check --quiet -
            mkdir -p "$HANKEL_TOOLS/bevy/${crate%-*}"
            tar -xzf "$archive" -C "$HANKEL_TOOLS/bevy/${crate%-*}" --strip-components=1 --wildcards \
                '*.wgsl' '*/LICENSE-*'
        done <xtask/tools/crates.txt
        installed crates.txt
    fi
fi

# Mesa's layer for choosing among several GPUs complains on a machine without a desktop.
export NODEVICE_SELECT=1
