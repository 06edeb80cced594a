// HLSL rounds 32-bit floats only. Adding 2^52 to what is smaller rounds it to a whole number.
double HankelFloor(double x)
{
    double size = abs(x);
    if (!(size < 4503599627370496.0L)) {
        return x;
    }
    precise double whole = size + 4503599627370496.0L;
    whole = whole - 4503599627370496.0L;
    if (x >= 0.0L) {
        return whole > size ? whole - 1.0L : whole;
    }
    return whole < size ? -whole - 1.0L : -whole;
}

