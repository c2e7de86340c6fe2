static int ha_finite(double a)
{
    return a - a == 0.0;
}

/* A slope times a rate; what does not move has no rate even where the slope is infinite. */
static double ha_along(double slope, double rate)
{
    return rate == 0.0 ? 0.0 : slope * rate;
}

static double ha_pow_along(double value, double a, double da, double b, double db)
{
    const double base = da == 0.0 ? 0.0 : b * ha_pow(a, b - 1.0) * da;
    const double exponent = db == 0.0 || value == 0.0 ? 0.0 : value * ha_log(a) * db;
    return base + exponent;
}

