#pragma once

#include "sim/methods/stepper.h"

namespace unfurl::sim {

// Where a polynomial in [0, 1] first passes zero, found without a miss: in Bernstein's form the
// coefficients bound it and their changes of sign bound the number of its zeros; the interval is
// halved until that says one or none.

// Smallest s in (from, 1] just past which p is above zero, given that it is not above at `from`
// (where rounding says otherwise, that is overlooked); -1: none.
double FirstAbove(const DensePolynomial& p, double from);

// False where p + something smaller than `margin`, whose slope is smaller than `margin` too, surely
// does not rise through zero in (0, 1].
bool MayRise(const DensePolynomial& p, double margin);

// A latch's watch: where p first comes to be above zero and rising. One that starts above zero, by
// rounding or since it was just left, is found as soon as it turns up again.
double FirstRise(const DensePolynomial& p);

// For a level that is to be crossed upwards. `above`: which side the motion is known to be on at
// the start, which counts for more than the sign of p there, as that may be rounding. -1: none.
double FirstUpcrossing(const DensePolynomial& p, bool above);

}  // namespace unfurl::sim
