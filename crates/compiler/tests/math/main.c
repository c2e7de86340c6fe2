/* Reads pairs of doubles, writes the value of the function whose number is given. */
#include <stdio.h>
#include <stdlib.h>

static double value(int function, double x, double y)
{
    switch (function) {
    case 0: return ha_sin(x);
    case 1: return ha_cos(x);
    case 2: return ha_tan(x);
    case 3: return ha_asin(x);
    case 4: return ha_acos(x);
    case 5: return ha_atan(x);
    case 6: return ha_exp(x);
    case 7: return ha_log(x);
    case 8: return ha_log10(x);
    case 9: return ha_sqrt(x);
    case 10: return ha_abs(x);
    case 11: return ha_sign(x);
    case 12: return ha_sinh(x);
    case 13: return ha_cosh(x);
    case 14: return ha_tanh(x);
    case 15: return ha_floor(x);
    case 16: return ha_atan2(x, y);
    case 17: return ha_min(x, y);
    case 18: return ha_max(x, y);
    case 19: return ha_mod(x, y);
    case 20: return ha_log2(x);
    case 21: return ha_pow(x, y);
    default: return 0.0;
    }
}

int main(int count, char **words)
{
    const int function = count > 1 ? atoi(words[1]) : -1;
    double pair[2];
    while (fread(pair, sizeof pair[0], 2, stdin) == 2) {
        const double result = value(function, pair[0], pair[1]);
        if (fwrite(&result, sizeof result, 1, stdout) != 1) {
            return 1;
        }
    }
    return 0;
}
