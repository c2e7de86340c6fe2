/* Quarter car with a cubic damper on a level road, states hub, tread, body, spring: as models/quarter_car. */
#include "rates.h"

static double ms = 320.0, mu = 40.0, ks = 18e3, kt = 190e3, b = 900.0, g = 9.81, road = 0.0;

void start(double *x)
{
    x[0] = 0.1;
    x[1] = 0.0186;
    x[2] = -0.05;
    x[3] = 0.1744;
}

void rates(double t, const double *x, double *dx)
{
    const double v = x[0] - x[2];
    const double f = ks * x[3] + b * v * v * v;
    (void)t;
    dx[0] = (kt * x[1] - f - mu * g) / mu;
    dx[1] = road - x[0];
    dx[2] = (f - ms * g) / ms;
    dx[3] = v;
}
