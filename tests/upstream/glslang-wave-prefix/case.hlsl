RWByteAddressBuffer result : register(u0);
[numthreads(64, 1, 1)]
void main(uint3 id : SV_DispatchThreadID) {
    result.Store(id.x * 4, WavePrefixSum(id.x));
}
