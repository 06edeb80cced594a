# Sourced by ./demo and ./check: installs what is missing, and says so. `for_tests=yes` asks for what
# only the tests need.

need() { # need COMMAND-OR-FILE PACKAGE
    command -v "$1" >/dev/null 2>&1 || [ -e "$1" ] || missing="$missing $2"
}

# The first of the files that exists.
first() {
    for file in "$@"; do
        [ -e "$file" ] && printf '%s' "$file" && return
    done
}

missing=
need c++ g++
if ! ldconfig -p 2>/dev/null | grep -q libvulkan.so.1; then missing="$missing libvulkan1"; fi
if [ -z "$(first /usr/share/vulkan/icd.d/*.json /etc/vulkan/icd.d/*.json)" ]; then
    missing="$missing mesa-vulkan-drivers"
fi
if [ "${for_tests:-no}" = yes ]; then need glslangValidator glslang-tools; fi

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

# Mesa's layer for choosing among several GPUs complains on a machine without a desktop.
export NODEVICE_SELECT=1
