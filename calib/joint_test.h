#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "calib/whitening.h"

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
  int index = 0;  // of the camera, point or reading
  Effect effect;
  double high = 0.0;  // of z [unit of z]
  double odds = 0.0;  // against nothing being wrong, before the data speak [-]
};

// A cause that was found.
struct FoundCause {
  CauseKind kind = CauseKind::kCamera;
  int index = 0;
  double probability = 0.0;  // of all that may be wrong [-]
  // The next probable one of another kind or index, and how probable; -1: none.
  CauseKind other_kind = CauseKind::kCamera;
  int other_index = -1;
  double other_probability = 0.0;  // [-]
};

// Misfits e ~ N(0, C) if nothing is wrong, against a list of what may be. [Kass & Raftery 1995:
// evidence of each hypothesis, its unknowns integrated out] All of it takes a time that grows with
// the number of misfits, where effects are local (calib/whitening.h).
class JointTest {
 public:
  JointTest(const Eigen::VectorXd& e, const GroupedCovariance& C);

  // Probability of so large a sum of squared whitened misfits, whatever the misfits along some
  // local effects are.
  double Chance() const;
  double ChanceWithoutAll(const std::vector<const Effect*>& free) const;
  // The same, each one free alone.
  std::vector<double> ChancesWithout(const std::vector<Effect>& each) const;
  // The least of that and of the probabilities of so large a misfit along each column of `shapes`,
  // with the price of having looked so often [Sidak]: one shape among many data is not drowned.
  double ScanChance(const Eigen::MatrixXd& shapes) const;

  // How much of one shape (k = 1) is in the misfits, by least squares, and its standard deviation.
  struct Amount {
    double value = 0.0, sigma = 0.0;  // [of the shape]; sigma is infinite for a zero shape
  };
  /// How much of one shape the residuals hold, with every column of the design free beside it.
  Amount AmountOf(const Effect& shape) const;
  // The amount of shape j that a test at `level` shows, and tells from every other column, nine
  // times in ten; infinity: none does.
  double ShownAmount(const Eigen::MatrixXd& shapes, Eigen::Index j, double level) const;

  // The causes, most telling first, at most `most`: the most probable one is let free and the rest
  // tested again, until a chance of `enough` is reached. `explained`: it was.
  std::vector<FoundCause> FindCauses(const std::vector<Hypothesis>& all, double enough,
                                     std::size_t most, bool* explained) const;

 private:
  double ChanceOf(const Whitening::Rest& rest) const;
  // The whitened effect of a hypothesis that is not local, beside what is free.
  struct WideEffect {
    std::size_t hypothesis = 0;
    Eigen::MatrixXd white;  // n x k [-]
    double whole = 0.0;     // its sum of squares before anything was free [-]
    Whitening::Products ProductsWith(const Eigen::VectorXd& rest) const {
      return {white.transpose() * white, white.transpose() * rest, whole};
    }
  };
  // `rest` are the whitened misfits beside the orthonormal columns `freed`; `wide` is in the order
  // of the hypotheses.
  FoundCause MostProbable(const std::vector<Hypothesis>& all, const std::vector<WideEffect>& wide,
                          const Eigen::VectorXd& rest, const Eigen::MatrixXd& freed,
                          const std::vector<FoundCause>& known) const;

  Eigen::VectorXd misfit_;  // e [px]
  Whitening whitening_;
  Eigen::VectorXd white_;  // W e [-]
};

}  // namespace unfurl::calib
