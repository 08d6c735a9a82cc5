#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <string>
#include <vector>

#include "calib/observations.h"
#include "calib/unit_slip.h"
#include "data/rig.h"

namespace unfurl::calib {

/// A slip in how a whole file was written, by what it does to the numbers.
struct Slip {
  bool found = false;
  std::string what;    // "x and y are exchanged"
  std::string remedy;  // "exchange the columns"
};

// A row that is read from its other end: what is wrong, and what to do about it.
std::string RowSlipOf(const std::string& camera);
std::string RowSlipRemedy(int pixels);

// Whether surveyed points fit a rig after all once coordinates are exchanged, reversed or read in
// millimetres (or in metres), or as they stand in another unit, two cameras' columns are exchanged,
// one camera's row is read from its other end, or each camera's readings belong to the row before
// or after: the readings' median misfit is then a twentieth of what it is as written, and below
// what counts as a misfit. `match`: the rig's camera of each of the data's.
Slip FindSlip(const data::Rig& rig, const Observations& data,
              const std::vector<std::size_t>& match);

// Whether a calibration came out so large or so small that its lengths must have been written in
// another unit than was said: no camera of this kind works at a kilometre, or at a millimetre.
Slip FindUnitSlip(const data::Rig& rig, ScaleFrom from = ScaleFrom::kSurvey);

// Whether places as stated are as far apart as found ones (by column, 3 x n [m]; a column that is
// not finite: not found) but for a unit of length. Gross errors of single places do not matter.
Slip FindScaleSlip(const Eigen::Matrix3Xd& stated, const Eigen::Matrix3Xd& found);

}  // namespace unfurl::calib
