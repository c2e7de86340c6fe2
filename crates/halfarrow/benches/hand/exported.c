/* The rates of an exported model; MODEL is its name, HEADER its header. */
#include HEADER
#include "rates.h"

#define JOINED(a, b) a##b
#define JOIN(a, b) JOINED(a, b)
#define OF(name) JOIN(MODEL, name)

static MODEL model;

void start(double *x)
{
    int i;
    (void)(OF(_reset)(&model) || OF(_start)(&model, 0.0));
    for (i = 0; i < STATES; ++i) {
        x[i] = model.x[i];
    }
}

void rates(double t, const double *x, double *dx)
{
    (void)OF(_rates)(&model, t, x, dx);
}
