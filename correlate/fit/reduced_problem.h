#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "correlate/align/registration.h"
#include "correlate/fit/evaluator.h"
#include "correlate/fit/parameter.h"

namespace unfurl::correlate {

// The fit with frame, time offset and the calibration's draw solved for at every parameter point
// (variable projection [Golub and Pereyra 1973]): they cost no evaluation of the model, so the
// solver sees the parameters alone. Rows: those of FitRegistration, trial by trial, then one per
// prior.
class ReducedProblem {
 public:
  // One trial's data in this stage; they and the whitening must outlive the problem. The
  // evaluator's stamps must be the observations' at `reference`.
  struct Part {
    std::size_t trial = 0;  // of the problem
    const Observations* observations = nullptr;
    Clock reference;
    Registration start;
    const RowWhitening* whitening = nullptr;  // null: white
  };
  // The problem at one set of parameters.
  struct Point {
    std::vector<Evaluator::Answer> prediction;  // by part
    std::vector<RegistrationFit> registration;
    Eigen::VectorXd residual;  // rows, the registrations at their best for these parameters [-]
    double cost = 0.0;         // half the sum of squares [-]
    std::string failure;       // in words, where a model failed
  };

  ReducedProblem(std::vector<Part> parts, const RegistrationOptions& options, Evaluator& evaluator);

  Eigen::Index rows() const { return rows_; }                // of the residual
  const std::vector<Part>& parts() const { return parts_; }  // the trials that take part
  // In the order of u.
  const std::vector<Parameter>& parameters() const { return evaluator_.problem().parameters; }
  // Where a part's rows begin, and after all parts those of the priors.
  Eigen::Index first_row(std::size_t part) const { return first_[part]; }
  Eigen::Index first_prior_row() const { return first_.back(); }

  // False: a model failed there.
  bool At(const std::vector<double>& u, Point* point, const std::string& purpose);
  // The same for points that have nothing to do with one another, in one batch.
  std::vector<bool> AtAll(const std::vector<std::vector<double>>& u, std::vector<Point>* points,
                          const std::string& purpose);

  // What these answers, one a part, are to the data at u; nothing is evaluated. False: one failed.
  bool CostOf(const std::vector<double>& u, std::span<const Evaluator::Answer> answers,
              Point* point) const;

  /// Whether the clocks `at`, by part, are so near to those of the stamps that the predictions'
  /// velocities carry a point's answers there. `misfit`: mean square of the residuals of data
  /// without sigmas.
  bool ClocksHold(const Point& point, const std::vector<Registration>& at,
                  double misfit = 1.0) const;

  // d residual / d u before projection, by one-sided differences, all evaluated at once. `sign` +1
  // or -1 says to which side; a bound or a failure turns a column to the other side. False: a
  // column failed on both. Steps: SetSteps. `change`, if wanted: of the predictions, per unit of u,
  // [part][parameter]. `beside` are other questions that go into the same batch.
  using Changes = std::vector<std::vector<Change>>;
  bool Sensitivity(const std::vector<double>& u, const Point& at, int sign, Eigen::MatrixXd* J,
                   Changes* change = nullptr, const std::vector<Evaluator::Request>& beside = {});

  /// The rows that known changes of the predictions make, d residual / d u before projection, those
  /// of the priors with them.
  Eigen::MatrixXd RowsOf(const std::vector<double>& u, const Point& at,
                         const Changes& change) const;

  // Both sides in one batch. Where they agree, their mean. Where they do not (an impact comes or
  // goes within the step: a kink), the mean is the slope of neither: the side that leads downhill
  // is taken, and where neither does, the steeper. `kinks` tells |D+ - D-| / |D+ + D-|; `change` as
  // for one side.
  bool CentralSensitivity(const std::vector<double>& u, const Point& at, Eigen::MatrixXd* J,
                          std::vector<double>* kinks = nullptr,
                          const std::vector<Evaluator::Request>& beside = {},
                          Changes* change = nullptr);

  // Takes the part out of J that a change of the registrations imitates (Kaufman's form).
  Eigen::MatrixXd Project(const Point& at, const Eigen::MatrixXd& J) const;

  // Steps of the values from the last sensitivities, which are those at u: each moves the rows of
  // the data by `target` RMS, in their standard deviations, within a twentieth of the value (of a
  // logarithm's or its start's, whichever is larger). Before the first: a thousandth of the start.
  void SetSteps(const std::vector<double>& u, const Eigen::MatrixXd& J, const Point& at,
                double target);
  const std::vector<double>& steps() const { return steps_; }
  void TakeSteps(std::vector<double> steps) { steps_ = std::move(steps); }
  // Registrations begin where those of a point are.
  void TakeStarts(const Point& point) {
    for (std::size_t i = 0; i < parts_.size(); ++i) parts_[i].start = point.registration[i].at;
  }

 private:
  // u with component j moved by one step to `side`; false: a bound is in the way.
  bool Shifted(const std::vector<double>& u, std::size_t j, int side,
               std::vector<double>* moved) const;
  std::vector<Evaluator::Request> RequestsAt(const std::vector<double>& u,
                                             const std::string& purpose) const;
  // CostOf, noted at the evaluator's records.
  bool Finish(const std::vector<double>& u, std::span<const Evaluator::Answer> answers,
              Point* point);

  std::vector<Part> parts_;
  RegistrationOptions options_;
  Evaluator& evaluator_;
  std::vector<Eigen::Index> first_;  // first row of each part; then that of the priors
  Eigen::Index rows_ = 0;
  std::vector<double> steps_;  // of the differences [the parameter's unit]
};

// Beyond this the differences to either side are of different motions.
inline constexpr double kKink = 0.3;  // [-]

// The sigma of one coordinate [m]: of the mean information of all samples, so that one that is put
// aside does not count.
double TypicalSigma(const Observations& observations);

// RMS distance between the marks of two answers at the same stamps [m].
double RmsDifference(const Prediction& a, const Prediction& b);

// The same in standard deviations of the data, of marks or of channels, whichever differ by more;
// `reference` is the clock of the stamps [-].
double RmsInSigmas(const Observations& observations, const Clock& reference, const Prediction& a,
                   const Prediction& b);

}  // namespace unfurl::correlate
