#pragma once

namespace unfurl::correlate {

/// What samples of the first `window` of a record of length `whole` tell of a damped sine's
/// frequency, over what all of them tell: Fisher's information, amplitude and phase being unknown
/// too, of even samples with equal errors [-]. The same of its decay rate. `decay` is a of
/// exp(-a t) [1/s]; 0 < window <= whole [s]. Where a whole >> 1 nearly all of it lies in the first
/// few 1/a; of a sine that does not decay, (window / whole)^3 [Kay 1993, ex. 3.14].
double InformationShare(double decay, double window, double whole);

}  // namespace unfurl::correlate
