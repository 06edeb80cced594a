ByteAddressBuffer input : register(t0);
RWStructuredBuffer<double> result : register(u1);
[numthreads(1, 1, 1)]
void main() {
    result[0] = input.Load<double>(0);
}
