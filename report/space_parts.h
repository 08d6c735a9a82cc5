#pragma once

#include "report/color_scale.h"
#include "report/space.h"

namespace unfurl::report {

// What the turning view and its still share.

double Length(const Place& v);
ColorScale ScaleFor(const SpaceCloud& cloud);
ColorScale ScaleFor(const SpaceEllipsoids& set);
void CheckSpace(const Space& space);  // throws Error, see space.h

}  // namespace unfurl::report
