/* DC motor whose speed a controller holds; the load comes on at 0.6 s. States i, w, integral: as models/dc_motor_pid. */
#include "rates.h"

static double ra = 1.0, la = 2e-3, kt = 0.05, j = 1e-4, b = 1e-5, kp = 0.1, ki = 2.0, ref = 100.0;

void start(double *x)
{
    x[0] = 0.5;
    x[1] = 20.0;
    x[2] = 0.1;
}

void rates(double t, const double *x, double *dx)
{
    const double error = ref - x[1];
    const double load = t < 0.6 ? 0.0 : 0.02;
    dx[0] = (kp * error + ki * x[2] - ra * x[0] - kt * x[1]) / la;
    dx[1] = (kt * x[0] - b * x[1] - load) / j;
    dx[2] = error;
}
