#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "data/run.h"
#include "data/scene.h"
#include "sim/methods/simulate.h"

namespace unfurl::sim {

/// What is stated may be half of the true error or four times it; so it aims at the middle of that,
/// as ratios go: sqrt(0.5 x 4).
inline constexpr double kCaution = 1.41;

/// What companions of a run are made to find its numerical error.
struct CertifyOptions {
  bool mesh = true;  ///< a run on another mesh, beside that of a tighter tolerance
  /// Names to certify, * and ? standing for letters; empty: marks' x and y, joints' coordinates.
  std::vector<std::string> quantities;
  bool progress = false;  ///< a line on the terminal
};

/// The numerical error of a run, quantity by quantity, from companions of it: the same scene at a
/// tenth of the tolerance, and on another mesh. Of the difference to the first the run's own error
/// of time stepping is nine tenths and more, as an error falls with the tolerance; of that to the
/// second the order of the mesh's error says which part is the run's (Richardson). What is stated
/// is the largest difference so far, times kCaution; docs/decisions/102-certificate.md.
class Certificate {
 public:
  /// One certified quantity, over a whole run.
  struct Line {
    std::string name, units;
    double time = 0.0, mesh = 0.0;  ///< errors, of time stepping and of the mesh [units]
    double range = 0.0;             ///< largest less smallest value of the run [units]
  };

  /// Runs the companions of a run of `scene` by `options`. Throws Error for a quantity that fits
  /// nothing, and Interrupted.
  static std::shared_ptr<Certificate> Make(const data::Scene& scene, const SimulateOptions& options,
                                           const CertifyOptions& certify);

  /// Why there is no certificate, such as a companion that failed; empty: there is one.
  const std::string& problem() const { return problem_; }
  /// What the mesh's companion was: "segments 4 in place of 8"; empty: none.
  const std::string& mesh() const { return mesh_; }

  /// Of a run that is being recorded: finds the certified among its quantities, and adds the
  /// columns error_time.NAME and error_mesh.NAME.
  void Bind(std::vector<data::Quantity>* quantities);
  /// The run's next sample, in the order of the quantities before Bind; its errors so far.
  const std::vector<double>& Add(std::span<const double> row);

  /// After the run.
  std::vector<Line> Lines() const;
  /// Of its largest loads, JOINT.peak_pin_force and JOINT.peak_moment, wherever in time companions
  /// have theirs, and no less than a thousandth, as peaks are looked for; `range` is the load
  /// itself. Loads of an impact change by more than motions do, and by no power of the mesh: where
  /// latches were struck the mesh's part is the whole difference, and no less a part of the load
  /// than it is of the loads of its kind (root mean square).
  std::vector<Line> LoadLines(const SimulateReport& run) const;

  /// What a certificate leaves unknown: where the error that is stated is larger than all that a
  /// quantity does. Of a position or an angle that is its range, or of a mark the longer one of its
  /// two coordinates; of a peak load the load. Velocities, loads and energies in time jump at
  /// impacts, and an impact that is late by an instant is wrong by all of its jump: of these the
  /// error's root mean square against that of the quantity about its mean. What does less than ten
  /// tolerances is known to do that.
  struct Unknown {
    std::string name;
    std::string text;      ///< "tip.x uncertain by 0.3 m, 120% of all that it does"
    std::string remedy;    ///< "use a smaller rtol"
    bool mesh = false;     ///< the larger part is the mesh's, else the tolerance's
    bool decides = false;  ///< the run is of no use: a position, an angle, what was named in full
    double part = 0.0;     ///< error over what it does [-]
  };
  /// The worst first.
  std::vector<Unknown> Unknowns(const SimulateReport& run) const;
  /// One line of why the run cannot be used, of the worst that decides; empty: it can.
  std::string Doubt(const SimulateReport& run) const;
  /// One line of what else is not known, the worst by its name; empty: nothing.
  std::string Warning(const SimulateReport& run) const;

 private:
  // Of one quantity in time: Welford's moments, and the error's square.
  struct Moments {
    double mean = 0.0, squares = 0.0, largest = 0.0;  // [units], [units^2], [units]
    std::vector<double> errors;                       // by companion, sums of squares [units^2]
  };
  struct Load {
    std::string name, units;
    bool contact;        // of a latch, else of a pin
    std::size_t number;  // of the latch or joint
    double Of(const SimulateReport& report) const {
      const std::vector<double>& peaks = contact ? report.peak_moment : report.peak_pin_force;
      return number < peaks.size() ? peaks[number] : 0.0;
    }
    std::string in_time;  // the quantity that has it in time
  };
  struct Companion {
    std::vector<std::vector<double>> columns;  // by certified quantity, one value a sample [units]
    std::vector<double> loads;                 // by load [N] or [N m]
    double factor = 0.0;                       // from a difference to the run's error [-]
  };
  // False, with problem() set, where the companion is not usable.
  bool Run(const data::Scene& scene, const SimulateOptions& options, double factor,
           const CertifyOptions& certify, const char* label);
  double LeastOf(const data::Quantity& quantity, const SimulateReport& run) const;
  double LoadScale(const char* units, const SimulateReport& run) const;
  void JudgePlaces(std::vector<Unknown>* out) const;
  void JudgeInTime(const SimulateReport& run, std::vector<Unknown>* out) const;
  void JudgeLoads(const SimulateReport& run, std::vector<Unknown>* out) const;
  bool Named(const std::string& name) const;

  std::string problem_, mesh_;
  std::vector<data::Quantity> certified_;
  std::vector<std::string> names_;  // CertifyOptions::quantities
  // Ten tolerances, below which nothing is promised [-]; and what they are tolerances of.
  double promised_ = 0.0, length_ = 0.0, duration_ = 0.0;  // [m], [s]
  std::vector<Load> loads_;
  std::vector<Companion> companions_;          // tolerance, then mesh
  std::vector<int> column_;                    // in the run's row, by certified quantity
  std::vector<double> errors_, least_, most_;  // [units]
  std::vector<Moments> moments_;               // by certified quantity
  std::size_t samples_ = 0;
};

/// The scene on another mesh: half the segments of every beam, or twice as many where `finer`,
/// where a beam would have fewer than four, and beside smooth beams; two more shapes of these.
/// `factor`: from the difference of the two to the error of `scene`. `words`: what was changed;
/// empty where no beam is there.
data::Scene CompanionMesh(const data::Scene& scene, bool finer, double* factor, std::string* words);

}  // namespace unfurl::sim
