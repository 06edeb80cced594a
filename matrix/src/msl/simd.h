// Answers `#include <simd/simd.h>`: the types are those of the other header.
#include <metal_stdlib>
