// Hamburger four moment shadow mapping step by step as published: what an expert writes by hand.
struct Receiver { float b1, b2, b3, b4, depth; };
cbuffer Biases : register(b0) { float moment_bias; float depth_bias; };
StructuredBuffer<Receiver> receiver : register(t1);
RWStructuredBuffer<float> shadow : register(u2);

float bound(float4 moments, float depth) {
    float4 b = lerp(moments, float4(0.5, 0.5, 0.5, 0.5), moment_bias);
    float3 z;
    z[0] = depth - depth_bias;
    float l32_d22 = mad(-b[0], b[1], b[2]);
    float d22 = mad(-b[0], b[0], b[1]);
    float square_variance = mad(-b[1], b[1], b[3]);
    float d33_d22 = dot(float2(square_variance, -l32_d22), float2(d22, l32_d22));
    float inv_d22 = 1.0 / d22;
    float l32 = l32_d22 * inv_d22;
    float3 c = float3(1.0, z[0], z[0] * z[0]);
    c[1] -= b.x;
    c[2] -= b.y + l32 * c[1];
    c[1] *= inv_d22;
    c[2] *= d22 / d33_d22;
    c[1] -= l32 * c[2];
    c[0] -= dot(c.yz, b.xy);
    float p = c[1] / c[2];
    float q = c[0] / c[2];
    float r = sqrt(p * p / 4.0 - q);
    z[1] = -p / 2.0 - r;
    z[2] = -p / 2.0 + r;
    float4 s = z[2] < z[0] ? float4(z[1], z[0], 1.0, 1.0)
             : (z[1] < z[0] ? float4(z[0], z[1], 0.0, 1.0) : float4(0.0, 0.0, 0.0, 0.0));
    float quotient = (s[0] * z[2] - b[0] * (s[0] + z[2]) + b[1]) / ((z[2] - s[1]) * (z[0] - z[1]));
    return saturate(s[2] + s[3] * quotient);
}

[numthreads(64, 1, 1)]
void main(uint3 id : SV_DispatchThreadID) {
    uint count, stride;
    shadow.GetDimensions(count, stride);
    if (id.x < count) {
        Receiver r = receiver[id.x];
        shadow[id.x] = bound(float4(r.b1, r.b2, r.b3, r.b4), r.depth);
    }
}
