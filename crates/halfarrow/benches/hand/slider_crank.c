/* Slider-crank with a spring at the slider, states w, compression of the spring, theta: as models/slider_crank. */
#include <math.h>
#include "rates.h"

static double j = 0.002, mass = 0.5, r = 0.1, l = 0.3, ks = 200.0, b = 0.005;

void start(double *x)
{
    const double theta = 75.0 * 3.14159265358979323846 / 180.0;
    x[0] = 0.0;
    x[1] = r * cos(theta) + sqrt(l * l - r * r * sin(theta) * sin(theta)) - sqrt(l * l - r * r);
    x[2] = theta;
}

void rates(double t, const double *x, double *dx)
{
    const double w = x[0];
    const double s = sin(x[2]);
    const double c = cos(x[2]);
    const double at = x[1] + sqrt(l * l - r * r); /* the slider */
    const double h = at - r * c;                  /* the rod along it */
    const double k = -r * s * at / h;             /* speed of the slider for a speed of 1 of the crank */
    const double v = k * w;
    /* d/dt of k: -r (c w at + s v) / h + r s at (v + r s w) / h^2 */
    const double dk = (-r * (c * w * at + s * v) - k * (v + r * s * w)) / h;
    const double torque = 0.1 * sin(10.0 * t) - b * w - k * ks * x[1];
    dx[0] = (torque - mass * k * dk * w) / (j + mass * k * k);
    dx[1] = v;
    dx[2] = w;
}
