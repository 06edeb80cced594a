// HLSL takes square roots of 32-bit floats only. Below, the digits of one are doubled twice, and the
// last one is settled by exact remainders.

// What the square of `root` leaves of `m` (Dekker's product); exact where `root` is nearly the root.
double HankelSqrtRest(double m, double root)
{
    precise double scaled = root * 134217729.0L;
    precise double high = scaled - (scaled - root);
    precise double low = root - high;
    precise double square = root * root;
    precise double lost = ((high * high - square) + (high * low) * 2.0L) + low * low;
    precise double rest = (m - square) - lost;
    return rest;
}

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
    root = root + HankelSqrtRest(m, root) / (root + root);
    // Whether the neighbour is nearer: half a step away, the rest is the root times a step.
    const double unit = 2.220446049250313e-16L;
    precise double rest = HankelSqrtRest(m, root);
    precise double step = root * unit;
    if (rest > step) {
        root = root + unit;
    } else if (rest <= -step) {
        root = root - unit;
    }
    return root * asdouble(0u, uint(k + 1023) << 20);
}

