#pragma once

#include <Eigen/Core>
#include <vector>

namespace unfurl::calib {

// What may be wrong where data contradict a rig.
enum class CauseKind {
  kCamera,   // one that was moved
  kPoint,    // a surveyed place, or the length in one placement of a bar
  kReading,  // of one camera at one point
  kFrame,    // all points alike: another frame, or a bar of another length
};
const char* Name(CauseKind kind);  // "camera", ...

// One thing that may be wrong: it adds `effect` z to the misfits, z ~ N(0, t^2) in each of its k
// components, with a size t that is as likely in each octave from the least that shows (one sigma)
// to `high`.
struct Hypothesis {
  CauseKind kind = CauseKind::kCamera;
  int index = 0;           // of the camera, point or reading
  Eigen::MatrixXd effect;  // n x k [per unit of z]
  double high = 0.0;
  double odds = 0.0;  // against nothing being wrong, before the data speak [-]
};

// A cause that was found.
struct FoundCause {
  CauseKind kind = CauseKind::kCamera;
  int index = 0;
  double probability = 0.0;  // of all that may be wrong
  // The next probable one of another kind or index, and how probable; -1: none.
  CauseKind other_kind = CauseKind::kCamera;
  int other_index = -1;
  double other_probability = 0.0;
};

// Misfits e ~ N(0, C) if nothing is wrong, against a list of what may be. [Kass & Raftery 1995:
// evidence of each hypothesis, its unknowns integrated out]
class JointTest {
 public:
  // C is positive definite.
  JointTest(const Eigen::VectorXd& e, const Eigen::MatrixXd& C);

  // Probability of so large a sum of squared whitened misfits, whatever the misfits along `free`
  // (n x k) are.
  double Chance() const;
  double ChanceWithout(const Eigen::MatrixXd& free) const;
  // The least of that and of the probabilities of so large a misfit along each column of `shapes`,
  // with the price of having looked so often [Sidak]: one shape among many data is not drowned.
  double ScanChance(const Eigen::MatrixXd& shapes) const;

  // How much of one shape is in the misfits, by least squares, and its standard deviation.
  struct Amount {
    double value = 0.0, sigma = 0.0;  // in units of the shape; sigma is infinite for a zero shape
  };
  /// How much of one shape the residuals hold, with every column of the design free beside it.
  Amount AmountOf(const Eigen::VectorXd& shape) const;
  // The amount of shape j that a test at `level` shows, and tells from every other column, nine
  // times in ten; infinity: none does.
  double ShownAmount(const Eigen::MatrixXd& shapes, Eigen::Index j, double level) const;

  // The causes, most telling first, at most `most`: the most probable one is let free and the rest
  // tested again, until a chance of `enough` is reached. `explained`: it was.
  std::vector<FoundCause> FindCauses(const std::vector<Hypothesis>& all, double enough,
                                     std::size_t most, bool* explained) const;

 private:
  Eigen::MatrixXd Whiten(const Eigen::MatrixXd& columns) const;
  FoundCause MostProbable(const std::vector<Hypothesis>& all,
                          const std::vector<Eigen::MatrixXd>& effects, const Eigen::VectorXd& rest,
                          const std::vector<FoundCause>& known) const;

  Eigen::MatrixXd root_;   // L of C = L L^T
  Eigen::VectorXd white_;  // L^-1 e
};

}  // namespace unfurl::calib
