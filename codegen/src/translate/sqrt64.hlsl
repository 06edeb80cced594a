// HLSL takes square roots of 32-bit floats only. This doubles the digits of one twice, and rounds by
// the exact remainder.
double HankelSqrt(double x)
{
    if (!(x > 0.0L)) {
        return x == 0.0L ? x : asdouble(0u, 0x7ff80000u);
    }
    // x = m * 2^(2k), where m is from 1 to 4.
    precise double m = x;
    int k = 0;
    if (m < 2.2250738585072014e-308L) {
        m = m * 18014398509481984.0L;
        k = -27;
    }
    uint low;
    uint high;
    asuint(m, low, high);
    if (high >= 0x7ff00000u) {
        return x;
    }
    int half_exponent = (int(high >> 20) - 1023) >> 1;
    m = asdouble(low, high - (uint(half_exponent) << 21));
    k += half_exponent;
    precise double root = double(sqrt(float(m)));
    root = (root + m / root) * 0.5L;
    root = (root + m / root) * 0.5L;
    // The square of the root and its error: Dekker's product.
    precise double scaled = root * 134217729.0L;
    precise double big = scaled - (scaled - root);
    precise double small = root - big;
    precise double square = root * root;
    precise double lost = ((big * big - square) + (big * small) * 2.0L) + small * small;
    precise double correction = ((m - square) - lost) / (root + root);
    root = root + correction;
    return root * asdouble(0u, uint(k + 1023) << 20);
}

