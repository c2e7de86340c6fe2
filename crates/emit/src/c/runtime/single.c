HA_FUNCTION float ha_sinf(float x)
{
    return (float)ha_sin((double)x);
}

HA_FUNCTION float ha_cosf(float x)
{
    return (float)ha_cos((double)x);
}

HA_FUNCTION float ha_tanf(float x)
{
    return (float)ha_tan((double)x);
}

HA_FUNCTION float ha_asinf(float x)
{
    return (float)ha_asin((double)x);
}

HA_FUNCTION float ha_acosf(float x)
{
    return (float)ha_acos((double)x);
}

HA_FUNCTION float ha_atanf(float x)
{
    return (float)ha_atan((double)x);
}

HA_FUNCTION float ha_expf(float x)
{
    return (float)ha_exp((double)x);
}

HA_FUNCTION float ha_logf(float x)
{
    return (float)ha_log((double)x);
}

HA_FUNCTION float ha_log2f(float x)
{
    return (float)ha_log2((double)x);
}

HA_FUNCTION float ha_log10f(float x)
{
    return (float)ha_log10((double)x);
}

HA_FUNCTION float ha_sinhf(float x)
{
    return (float)ha_sinh((double)x);
}

HA_FUNCTION float ha_coshf(float x)
{
    return (float)ha_cosh((double)x);
}

HA_FUNCTION float ha_tanhf(float x)
{
    return (float)ha_tanh((double)x);
}

HA_FUNCTION float ha_powf(float x, float y)
{
    return (float)ha_pow((double)x, (double)y);
}

HA_FUNCTION float ha_atan2f(float x, float y)
{
    return (float)ha_atan2((double)x, (double)y);
}

HA_FUNCTION void ha_turnf(float x, float *both)
{
    double exact[2];
    ha_turn((double)x, exact);
    both[0] = (float)exact[0];
    both[1] = (float)exact[1];
}

HA_FUNCTION float ha_signf(float x)
{
    return x > 0.0f ? 1.0f : x < 0.0f ? -1.0f : x == 0.0f ? 0.0f : x;
}

HA_FUNCTION float ha_minf(float x, float y)
{
    return y < x || x != x ? y : x;
}

HA_FUNCTION float ha_maxf(float x, float y)
{
    return y > x || x != x ? y : x;
}

