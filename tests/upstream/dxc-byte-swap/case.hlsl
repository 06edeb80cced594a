ByteAddressBuffer values : register(t0);
RWByteAddressBuffer result : register(u1);

[numthreads(1, 1, 1)]
void main()
{
    uint x = values.Load(0);
    result.Store(0, (((x >> 24u) | ((x >> 8u) & 65280u)) | (((x << 8u) & 16711680u) | (x << 24u))));
}
