#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <limits>
#include <span>

namespace unfurl::measure {

// Two numbers scale all that is believed of a mark's motion; Reconstructor takes them from the rig
// and the record. The defaults are of marks in a volume of some metres, seen 200 times a second.
struct MotionOptions {
  double interval = 0.005;   // between two samples of a mark [s]
  double max_speed = 20.0;   // of any mark, ever [m/s]
  double gate_sigmas = 5.0;  // of its own error, within which a point must continue the motion [-]

  // The furthest that a mark comes in one interval [m].
  double reach() const { return max_speed * interval; }
  // Older samples tell nothing of velocity [s].
  double longest_gap() const { return 20.0 * interval; }
  // What a mark may do between two samples beyond moving on as it did (a latch kicks) [m/s^2]: from
  // rest to its highest speed within the longest gap. Points that no reading is left over to vouch
  // for must lie within half of it times the square of the time since.
  double max_acceleration() const { return max_speed / longest_gap(); }
  // Sigma of the speed of a mark that is expected somewhere, until it shows [m/s].
  double start_speed() const { return 0.05 * max_speed; }
  // Throws Error that names a value which makes no sense.
  void Check() const;
};

// How one mark moves, learned from its samples as they come: four Kalman filters side by side
// (position, velocity, acceleration; white jerk, the same along all axes), for a mark that glides,
// ones that vibrate and one that is kicked, and how likely each is (interacting multiple model,
// Blom and Bar-Shalom 1988). It tells where a sample is to be expected and never touches the
// sample.
class Motion {
 public:
  static constexpr int kModels = 4;  // filters

  // A sum of isotropic Gaussians: one for each way of moving, or for each pair of ways before and
  // after.
  struct Prediction {
    static constexpr std::size_t kMost = kModels * kModels;
    std::size_t count = 0;
    std::array<Eigen::Vector3d, kMost> mean;
    std::array<double, kMost> variance{};  // [m^2]
    std::array<double, kMost> weight{};    // sum to 1 [-]
    // Index of the heaviest of them, and its middle [m].
    std::size_t LikeliestAt() const {
      const auto end = weight.begin() + static_cast<std::ptrdiff_t>(count);
      return static_cast<std::size_t>(std::max_element(weight.begin(), end) - weight.begin());
    }
    const Eigen::Vector3d& Likeliest() const { return mean[LikeliestAt()]; }
  };

  explicit Motion(const MotionOptions& options = {});

  // Where the mark is before its first sample, when somebody knows; sigma [m].
  void Expect(const Eigen::Vector3d& p, double sigma);
  // The first line that should show it: from here on what was expected fades.
  void Begin(double t) { expected_t_ = std::min(expected_t_, t); }
  // A sample; `variance` of one axis [m^2].
  void Add(double t, const Eigen::Vector3d& p, double variance);

  // As if it had never been seen.
  void Forget() { count_ = 0; }

  // Anything is known of where the mark is.
  bool known() const { return count_ > 0 || expected_sigma_ > 0.0; }
  bool seen() const { return count_ > 0; }
  // Two samples tell where the mark moves, and they are fresh enough.
  bool Fresh(double t) const;
  // It was seen, and not for longer than the longest gap; or it was expected and did not show.
  bool Lost(double t) const {
    return count_ > 0 ? t - t_[1] > options_.longest_gap() : t > expected_t_;
  }
  // A start for the search: moved on along a straight line where that is known.
  Eigen::Vector3d Start(double t) const;
  // Where it is to be expected; after a longer gap, a wide circle around where it was last.
  Prediction Predict(double t) const;
  // The same with what comes later: `after` learned it from samples at times -t, the latest first.
  Prediction Between(double t, const Motion& after) const;
  // How far a mark may be from Start by what it may do since it was seen; infinity where nothing
  // fresh is known [m].
  double Reach(double t) const;
  // What the filters cannot exclude: within reach of `p`, whose own sigma is given [m]. True where
  // nothing fresh is known.
  bool WithinReach(double t, const Eigen::Vector3d& p, double sigma) const;
  // No mark gets there in the time since it was last seen.
  bool TooFast(double t, const Eigen::Vector3d& p) const;

 private:
  struct Model {
    Eigen::Matrix3d x = Eigen::Matrix3d::Zero();  // rows: position, velocity, acceleration [SI]
    Eigen::Matrix3d P = Eigen::Matrix3d::Zero();  // of one axis [SI]
    double weight = 1.0 / kModels;                // [-]
  };
  using Models = std::array<Model, kModels>;
  // Mixed and carried on by dt; weights before the sample is known.
  Models Carried(double dt) const;

  MotionOptions options_;
  std::array<double, kModels> jerk_{};  // spectral density, by way of moving [m^2/s^5]
  Models models_;
  std::array<double, 2> t_{};  // of the last two samples [s]
  std::array<Eigen::Vector3d, 2> p_{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};  // [m]
  Eigen::Vector3d expected_ = Eigen::Vector3d::Zero();                                  // [m]
  double expected_sigma_ = 0.0;                                                         // [m]
  double expected_t_ = std::numeric_limits<double>::infinity();                         // [s]
  int count_ = 0;  // of samples in a row without a long gap, up to 2
};

// log of the sum of exp(term); one term at least.
double LogSum(std::span<const double> terms);

// log of the prediction's density at a point whose own error has covariance `cov` [1/m^3].
double LogDensity(const Motion::Prediction& at, const Eigen::Vector3d& p,
                  const Eigen::Matrix3d& cov);

}  // namespace unfurl::measure
