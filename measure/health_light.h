#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "measure/health.h"

namespace unfurl::measure {

// Changes of light and of focus, from flashes whose spots were measured (readings of others have no
// light). Where marks are changes what is seen of them, too: by functions of their place in each
// camera's view, whose coefficients are found with the faults.
std::vector<LightFault> FindLightFaults(const HealthEvidence& evidence,
                                        const Triangulator& triangulator,
                                        const HealthOptions& options);

// One spot, and what its camera makes of where it was.
struct LightLook {
  double t = 0.0;  // [s]
  int mark = 0, slice = 0;
  double flux = 0.0;              // its logarithm [-]
  double width = 0.0;             // [px]
  std::array<double, 6> place{};  // ln of distance; slopes x, y and their products [-]
};
// All spots by camera, in order of time; `slices` of the record's time.
std::vector<std::vector<LightLook>> LooksOf(const HealthEvidence& evidence,
                                            const Triangulator& triangulator, int slices);

// One camera's light (its logarithm) by mark and slice of time, with what place, mark and time at
// rest explain taken out.
class LightSide {
 public:
  LightSide(const std::vector<LightLook>& looks, int marks, int slices);

  bool tells() const { return sigma_ > 0.0; }  // enough was seen
  // Of a change whose course in time is `shape` (by slice), of one mark or of all (-1): in units of
  // the scatter, what is left of it once the rest is explained, by itself and with the data.
  struct Terms {
    double square = 0.0, product = 0.0;
  };
  Terms TermsOf(int mark, const Eigen::VectorXd& shape) const;
  // Takes such a change of size `size` out.
  void Take(int mark, const Eigen::VectorXd& shape, double size);
  // Scatter and its persistence anew, as if the change was no part of the data.
  double Persistence(int mark, const Eigen::VectorXd& shape, double size) const;
  std::size_t redundant() const;  // numbers that are left over

 private:
  struct Cell {
    int mark = 0, slice = 0;
  };
  std::pair<std::size_t, std::size_t> CellsOf(int mark) const;  // first and one behind the last
  Eigen::VectorXd Column(int mark, const Eigen::VectorXd& shape) const;
  void Scatter();

  int slices_ = 0;
  std::vector<Cell> cells_;        // by mark, then slice
  std::vector<std::size_t> ends_;  // of each mark's
  Eigen::MatrixXd q_;              // cells x rank, orthonormal: what place and mark explain
  Eigen::VectorXd y_;              // what they leave [-]
  double sigma_ = 0.0;             // robust, of a cell [-]
};

// Light or width of one mark in one camera around slices first to last.
class LightSeries {
 public:
  LightSeries(const std::vector<LightLook>& looks, bool width, int mark, int first, int last);

  // Of light its logarithm, of a width its square [px^2]: the level just before the slices, what it
  // jumps by, and the jump's variance: by flashes on either side, a course of second order with the
  // jump, and what one of third order makes of it. False: too few flashes.
  bool Jump(double* level, double* jump, double* variance) const;
  // Of flashes within the slices their logarithm, if it had not changed; of the others, with a
  // change of `size` taken out, the squares of what is left.
  void Read(double size, std::vector<std::pair<double, double>>* flashes,
            std::vector<double>* squares) const;

 private:
  bool Within(const LightLook& look) const { return look.slice >= first_ && look.slice <= last_; }
  bool Fit(int order, double* level, double* jump, double* variance) const;

  bool width_ = false;
  int first_ = 0, last_ = 0;
  std::vector<const LightLook*> near_;
};

// A change that may have come at once within slices first to last.
struct LightMoment {
  LightSubject subject;
  bool width = false;
  int marks = 0, first = 0, last = 0;
  double size = 0.0;  // of the logarithm
};
// When it did, by single flashes: between which two. False where flashes show that it came little
// by little, or show nothing.
bool FindMoment(const std::vector<std::vector<LightLook>>& looks, const LightMoment& moment,
                double* earliest, double* latest);

// Of a record's time.
struct LightClock {
  double from = 0.0, span = 1.0;  // [s]
  int slices = 1;
  double Edge(double slice) const {
    const double share = slice / slices;
    return from + span * (share < 0.0 ? 0.0 : share > 1.0 ? 1.0 : share);
  }
};

// Cameras whose spots become wider or narrower at once, with all marks.
void FindFocusFaults(const std::vector<std::vector<LightLook>>& looks, int marks,
                     const LightClock& clock, const HealthOptions& options,
                     std::vector<LightFault>* faults);

}  // namespace unfurl::measure
