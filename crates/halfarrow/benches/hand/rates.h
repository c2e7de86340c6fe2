/* What a model gives: the number of its states (with -DSTATES), start values, rates. */
void start(double *x);
void rates(double t, const double *x, double *dx);
