#pragma once

#include <string>
#include <vector>

#include "data/function_scan.h"
#include "sim/model/model.h"

namespace unfurl::sim {

// Whether steps see what functions of time (drives, motors, forces) do. An estimate of a step's
// error sees them at the method's own stages alone, and a function that swings faster than these
// looks slow there. So before a step each function is held against a polynomial through some of
// its values within the step: where it is off at others, the step is too long. What could hide
// between all of these is found at the start, by bounds of the function over whole stretches
// (data::FunctionScan); steps there are so short that it cannot.
class FunctionWatch {
 public:
  // `longest`: step that is allowed [s].
  FunctionWatch(const Model& model, double duration, double rtol, double longest);

  bool empty() const { return watched_.empty(); }
  // The longest step of h, h / 2, h / 4, ... [s] from t [s] within which no function does what
  // its polynomial does not. Call with the steps of a run, in order.
  double Resolved(double t, double h);
  // Of a run whose steps have long been as short as no run can end with: the function that asks
  // for it. Empty: none.
  std::string Complaint() const;
  // What cannot be guaranteed, one line for each function.
  std::vector<std::string> Warnings() const;

 private:
  struct Watched {
    const Model::Function* of;
    double low, high;    // of the values seen
    double hidden_part;  // of its area: what a pulse that no step sees may have at most
    // Where steps must be short, in order: the longest that sees all of the cell.
    std::vector<data::FunctionScan::Cell> cells;
    std::size_t at = 0;  // the first cell that is not over
    // The value, or the derivative that the equations of motion hold.
    double At(double t) const;
    // The longest step from t, of h, that no cell is too short for.
    double Allowed(double t, double h);
    bool Follows(double t, double h, double part);
    void See(double value);
  };
  std::vector<Watched> watched_;
  const double hopeless_;  // step [s]
  const double part_;      // of a function's range, that it may be off its polynomial
  const Watched* last_ = nullptr;
  long hopeless_steps_ = 0;  // one after the other
};

}  // namespace unfurl::sim
