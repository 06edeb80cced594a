RWByteAddressBuffer numbers : register(u0);

[numthreads(1, 1, 1)]
void main(uint3 id : SV_DispatchThreadID)
{
    uint64_t wide = uint64_t(id.x) << 20u;
    numbers.Store(0, uint(wide >> 32u));
}
