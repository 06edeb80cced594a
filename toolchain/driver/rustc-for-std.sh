#!/bin/sh
# Cargo's RUSTC while the standard library is built. Its build scripts need a
# standard library to link with, which the new compiler does not have yet: the
# bootstrap compiler takes those, the new one everything else.
for argument in "$@"; do
  case $argument in
    build_script_*) exec "$HANKEL_BOOTSTRAP_RUSTC" "$@" ;;
  esac
done
exec "$HANKEL_NEW_RUSTC" "$@"
