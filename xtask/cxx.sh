# Sourced by ./check where CI=true and everything is built once. SPIRV-Tools' C++ is the largest part of
# a build, and most of it is reading the same headers: clang reads them once, as a precompiled header.
# Not for developers: with other CXXFLAGS than the last build had, all of it is compiled again.
spirv_tools=$(sed -n '/^name = "spirv-tools-sys"$/{n;s/version = "\(.*\)"/\1/p;}' Cargo.lock)
cargo fetch --locked --quiet
source=$(first "${CARGO_HOME:-$HOME/.cargo}"/registry/src/*/spirv-tools-sys-"$spirv_tools" || true)
host=$(rustc -vV | sed -n 's/^host: //p')
header=$PWD/target/spirv-tools.pch
if [ -n "$source" ] && [ "$host" = x86_64-unknown-linux-gnu ] && command -v clang++-19 >/dev/null; then
    echo "Precompiling the headers of SPIRV-Tools $spirv_tools"
    mkdir -p target
    # What changes the meaning of a header is as in the crate's build.rs.
    if (cd "$source" && clang++-19 -O2 -fPIC -m64 --target="$host" -std=c++17 -fno-exceptions -fno-rtti \
        -ftemplate-depth=1024 -DSPIRV_CHECK_CONTEXT -DSPIRV_LINUX \
        -I spirv-tools -I spirv-tools/include -I generated -I spirv-headers/include \
        -I spirv-headers/include/spirv/unified1 -fpch-instantiate-templates -x c++-header \
        -include source/val/validate.h -o "$header" spirv-tools/source/opt/ir_context.h); then
        export CXX=clang++-19 CXXFLAGS="-include-pch $header"
    fi
fi
