#pragma once

#include "sim/methods/stepper.h"

namespace unfurl::sim {

// Where a polynomial in [0, 1] first passes zero, found without a miss: in Bernstein's form the
// coefficients bound it and their changes of sign bound the number of its zeros (Descartes' rule);
// the interval is halved until at most one zero is left.

// Smallest s in (from, 1] just past which p is above zero, given that it is not above at `from`
// (a positive p(from) is taken for rounding); -1: none.
double FirstAbove(const DensePolynomial& p, double from);

// False where p + something smaller than `margin`, whose slope is smaller than `margin` too, surely
// does not rise through zero in (0, 1].
bool MayRise(const DensePolynomial& p, double margin);

// For the stops of a latch: where p is first above zero and rising. If p starts above zero, by
// rounding or because the stop was just left, that is where p turns up again.
double FirstRise(const DensePolynomial& p);

// Where p first crosses zero upwards; -1: nowhere. `above`: the side that the motion is known to be
// on at the start. It overrules the sign of p there, which may be rounding.
double FirstUpcrossing(const DensePolynomial& p, bool above);

}  // namespace unfurl::sim
