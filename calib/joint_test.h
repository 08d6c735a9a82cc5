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
  // Which hypothesis of this cause is the most telling, as an index into all, and its unknowns with
  // the other causes free.
  std::size_t hypothesis = 0;
  Eigen::VectorXd amount;
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
  Amount AmountOf(const Effect& shape) const;  ///< beside nothing else
  // The same with all of what causes do free, `freed` from Free.
  Amount AmountOf(const Effect& shape, const Eigen::MatrixXd& freed) const;
  // The amount of shape j that a test at `level` shows, and tells from every other column, nine
  // times in ten; infinity: none does.
  double ShownAmount(const Eigen::MatrixXd& shapes, Eigen::Index j, double level) const;

  // Orthonormal columns of whatever causes do.
  Eigen::MatrixXd Free(const std::vector<Hypothesis>& all,
                       const std::vector<FoundCause>& causes) const;

  // The fewest causes without which the rest is as probable as `enough`, at most `most`, those that
  // concern most of the data first; of as many the most probable. The most probable one is let free
  // and the rest weighed again; where that takes several, or leads nowhere, so it goes from each
  // cause of more than one group: what two of them do together may look like a third. Each one's
  // probability is beside the others. `explained`: they suffice.
  std::vector<FoundCause> FindCauses(const std::vector<Hypothesis>& all, double enough,
                                     std::size_t most, bool* explained) const;

 private:
  double ChanceOf(const Whitening::Rest& rest) const;
  // The whitened effect of a hypothesis that is not local.
  struct WideEffect {
    std::size_t hypothesis = 0;
    Eigen::MatrixXd white;  // n x k [-]
  };
  // A cause beside others, and the log of its evidence times its odds.
  struct Weighed {
    FoundCause cause;
    double log_weight = 0.0;
  };
  struct Chain {
    std::vector<FoundCause> causes;
    bool explained = false;
    double log_weight = 0.0;  // of all together
  };
  double ChanceBeside(const Eigen::MatrixXd& freed) const;
  // Each cause that is not `known`, by what is left beside those. `wide` is in the order of all.
  std::vector<Weighed> Weigh(const std::vector<Hypothesis>& all,
                             const std::vector<WideEffect>& wide,
                             const std::vector<FoundCause>& known) const;
  Chain Follow(const std::vector<Hypothesis>& all, const std::vector<WideEffect>& wide,
               const Weighed* first, double enough, std::size_t most) const;
  // Each one's probability beside the others; one that another one replaces gives way.
  void Settle(const std::vector<Hypothesis>& all, const std::vector<WideEffect>& wide,
              double enough, Chain* chain) const;

  Eigen::VectorXd misfit_;  // e [px]
  Whitening whitening_;
  Eigen::VectorXd white_;  // W e [-]
};

}  // namespace unfurl::calib
