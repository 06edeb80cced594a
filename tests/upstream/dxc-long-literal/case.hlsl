ByteAddressBuffer values : register(t0);
RWByteAddressBuffer result : register(u1);

[numthreads(1, 1, 1)]
void main()
{
    result.Store(0, uint((uint64_t(values.Load(0)) + 13787848793156543929uL) >> 32u));
}
