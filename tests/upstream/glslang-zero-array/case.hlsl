RWByteAddressBuffer result : register(u1);

[numthreads(1, 1, 1)]
void main(uint3 id : SV_DispatchThreadID)
{
    float values[4] = (float[4])0;
    values[id.x & 3u] = 1.0f;
    result.Store(0, asuint(values[id.y & 3u]));
}
