ByteAddressBuffer input : register(t0);
RWByteAddressBuffer result : register(u1);
[numthreads(1, 1, 1)]
void main() {
    uint size;
    input.GetDimensions(size);
    result.Store(0, size);
}
