//item $ha_finite
static int $ha_finite($real a)
{
    return a - a == $0.0;
}

//item $ha_along
/* A slope times a rate; what does not move has no rate even where the slope is infinite. */
static $real $ha_along($real slope, $real rate)
{
    return rate == $0.0 ? $0.0 : slope * rate;
}

//item $ha_pow_along
static $real $ha_pow_along($real value, $real a, $real da, $real b, $real db)
{
    const $real base = da == $0.0 ? $0.0 : b * $ha_pow(a, b - $1.0) * da;
    const $real exponent = db == $0.0 || value == $0.0 ? $0.0 : value * $ha_log(a) * db;
    return base + exponent;
}

