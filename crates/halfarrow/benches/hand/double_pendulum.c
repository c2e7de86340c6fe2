/* Double pendulum of point masses, angles from the vertical, states w1, w2, phi1, phi2: as models/double_pendulum. */
#include <math.h>
#include "rates.h"

static double m1 = 1.2, m2 = 0.8, l1 = 0.6, l2 = 0.9, g = 9.81;

void start(double *x)
{
    x[0] = 0.0;
    x[1] = 0.0;
    x[2] = 1.0;
    x[3] = -0.4;
}

void rates(double t, const double *x, double *dx)
{
    const double s = sin(x[2] - x[3]);
    const double c = cos(x[2] - x[3]);
    const double a = (m1 + m2) * l1 * l1;
    const double b = m2 * l1 * l2 * c;
    const double d = m2 * l2 * l2;
    const double f1 = -m2 * l1 * l2 * x[1] * x[1] * s - (m1 + m2) * g * l1 * sin(x[2]);
    const double f2 = m2 * l1 * l2 * x[0] * x[0] * s - m2 * g * l2 * sin(x[3]);
    const double det = a * d - b * b;
    (void)t;
    dx[0] = (d * f1 - b * f2) / det;
    dx[1] = (a * f2 - b * f1) / det;
    dx[2] = x[0];
    dx[3] = x[1];
}
