#pragma once

#include <vector>

namespace unfurl::bench {

// The deflection of the rod's middle of SliderCrank from its chord, over its length [-], by an
// inextensible rod in nine modes of its angle and Fehlberg's method (tests/verification): none of
// the simulator's code. At even times from 0, `rate` a second [1/s], to the scene's end.
std::vector<double> ModalSliderCrank(double rate);

}  // namespace unfurl::bench
