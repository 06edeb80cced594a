RWStructuredBuffer<float> result : register(u0);
[numthreads(1, 1, 1)]
void main(uint3 id : SV_DispatchThreadID) {
    result[id.x] = id.x > 3u ? 1.2980742e33 : 1.1529215e18;
}
