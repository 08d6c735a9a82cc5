#pragma once

#include <vector>

#include "study/cost_values.h"

namespace unfurl::study {

/// What a quantity is towards the continuum, and how well that is known.
struct CostLimit {
  CostValues values;
  CostDistance error;         ///< of the values; infinite: the meshes do not settle [its unit]
  double spread = 1.0;        ///< by how much the error of one mesh's values comes through [-]
  bool extrapolated = false;  ///< beyond the finest mesh (Richardson)
  bool settles = false;       ///< three meshes or more show that they come to an end
};

/// Of a quantity on meshes of rising size. `power`: with which errors fall, size^-power, in theory;
/// extrapolated where that is `regular`, that is where errors are known to follow a power series.
/// Of one mesh: its values, known to nothing; of two: the finer, known to their difference.
CostLimit LimitOf(const std::vector<CostValues>& values, const std::vector<double>& sizes,
                  double power, bool regular);

/// The better known of two limits of the same; where they are further apart than they say, known to
/// what is left. What meshes do not show to come to an end is not known better than another one, of
/// which nothing else is known, lies apart from it.
CostLimit Joined(const CostLimit& a, const CostLimit& b);

}  // namespace unfurl::study
