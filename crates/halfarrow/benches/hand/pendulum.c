/* Physical pendulum about a fixed pivot, states w, phi: as models/pendulum. */
#include <math.h>
#include "rates.h"

static double J = 0.3, M = 2.0, a = 0.75, g = 9.81;

void start(double *x)
{
    x[0] = 0.7;
    x[1] = 0.4;
}

void rates(double t, const double *x, double *dx)
{
    (void)t;
    dx[0] = -M * g * a * cos(x[1]) / (J + M * a * a);
    dx[1] = x[0];
}
