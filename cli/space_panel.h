#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "calib/plan.h"
#include "data/rig.h"
#include "report/space.h"

namespace unfurl::cli {

report::Place PlaceOf(const Eigen::Vector3d& p);

// A rig's volume with its cameras and what each sees of it: along its row from the first pixel to
// the last, across it as far as the volume reaches, up to the volume's middle.
report::Space SpaceOf(const data::Rig& rig, const std::string& title, const std::string& note);

// One sigma of a found point with this covariance [m^2]; `value` is its colour.
report::SpaceEllipsoid EllipsoidOf(const Eigen::Vector3d& at, const Eigen::Matrix3d& covariance,
                                   double value);

// Ellipsoids of a map, thinned to what can be told apart. `high_mm`: the colours' upper end; NaN:
// by the map.
report::SpaceEllipsoids EllipsoidsOf(const calib::UncertaintyMap& map, const std::string& name,
                                     double high_mm);

// Places, each coloured by the RMS of its readings' residuals over what they should be.
class ReadingsCloud {
 public:
  explicit ReadingsCloud(std::size_t points) : points_(points) {}
  // `expected_px`: the residual's standard deviation, or 1 for plain residuals; 0 or NaN: it cannot
  // show anything.
  void Add(std::size_t point, int camera, double residual_px, double expected_px, bool refused);
  // Points with a place; the worst of them where they are more than a view holds.
  report::SpaceCloud Cloud(const std::vector<std::string>& ids, const Eigen::Matrix3Xd& p,
                           const report::Axis& value) const;

 private:
  struct Sums {
    double squared = 0.0;
    int count = 0;
    std::uint32_t seen = 0, refused = 0;
  };
  std::vector<Sums> points_;
};

// Of a cloud with more points than a view holds, those of the largest values, in their order.
void KeepWorst(report::SpaceCloud* cloud);

}  // namespace unfurl::cli
