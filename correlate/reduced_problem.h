#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "correlate/evaluator.h"
#include "correlate/parameter.h"
#include "correlate/registration.h"

namespace unfurl::correlate {

// The fit with frame, time offset and the calibration's draw solved for at every parameter point
// (variable projection [Golub and Pereyra 1973]): they cost no evaluation of the model, so the
// solver sees the parameters alone. Rows: those of FitRegistration, then one per prior.
class ReducedProblem {
 public:
  struct Point {
    Evaluator::Answer prediction;
    RegistrationFit registration;
    Eigen::VectorXd residual;  // rows, the registration at its best for these parameters
    double cost = 0.0;         // half the sum of squares
  };

  // `observations` are those of this stage; the evaluator's stamps must be theirs at `offset_ref`.
  ReducedProblem(const Model& model, const std::vector<Parameter>& parameters,
                 const Observations& observations, double offset_ref, const Registration& start,
                 const RegistrationOptions& options, Evaluator& evaluator);

  Eigen::Index rows() const { return rows_; }
  const Observations& observations() const { return observations_; }
  double offset_ref() const { return offset_ref_; }

  // False: the model failed there.
  bool At(const std::vector<double>& u, Point* point, const std::string& purpose);

  // d residual / d u before projection, by one-sided differences, all evaluated at once. `sign` +1
  // or -1 says to which side; a bound or a failure turns a column to the other side. False: a
  // column failed on both. Steps: SetSteps. `change`, if wanted: the same in metres in the model's
  // frame, [parameter][mark]. `beside` are other questions that go into the same batch.
  using Change = std::vector<std::vector<Eigen::Matrix3Xd>>;
  bool Sensitivity(const std::vector<double>& u, const Point& at, int sign, Eigen::MatrixXd* J,
                   Change* change = nullptr, const std::vector<Evaluator::Request>& beside = {});

  // The mean of both sides, all points in one batch.
  bool CentralSensitivity(const std::vector<double>& u, const Point& at, Eigen::MatrixXd* J);

  // Takes the part out of J that a change of the registration imitates (Kaufman's form).
  Eigen::MatrixXd Project(const Point& at, const Eigen::MatrixXd& J) const;

  // Steps in u from the last sensitivities: each moves the marks by `target` RMS [m], within a
  // tenth of the range between the bounds. Before the first: `relative` of the value.
  void SetSteps(const Eigen::MatrixXd& J, const Point& at, double target);
  const std::vector<double>& steps() const { return steps_; }
  void TakeSteps(std::vector<double> steps) { steps_ = std::move(steps); }

 private:
  // u with component j moved by one step to `side`; false: a bound is in the way.
  bool Shifted(const std::vector<double>& u, std::size_t j, int side,
               std::vector<double>* moved) const;

  const Model& model_;
  const std::vector<Parameter>& parameters_;
  const Observations& observations_;
  double offset_ref_;
  Registration start_;
  RegistrationOptions options_;
  Evaluator& evaluator_;
  Eigen::Index rows_ = 0;
  std::vector<double> steps_;
};

// RMS of the sigma of one coordinate over all samples [m].
double TypicalSigma(const Observations& observations);

}  // namespace unfurl::correlate
