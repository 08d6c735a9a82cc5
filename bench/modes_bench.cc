// What modes from a free decay cost, and how near they come to the Cramer-Rao bound, against length
// of record, noise, and order of the pencil. Three modes on four strobed marks.
//   modes_bench [draws]       (default 100)
#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <ctime>

#include "correlate/modes/modal_id.h"
#include "tests/correlate/free_decay.h"

namespace {

using namespace unfurl;
using namespace unfurl::correlate;

double Seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

void Row(double duration, double ratio, int max_order, int draws) {
  PlantedDecay planted = StrobedDecay(3, ratio);
  for (std::size_t j = 0; j < planted.t.size(); ++j) {
    planted.t[j] = EvenStamps(0.001 * static_cast<double>(j), duration, 0.01);
  }
  const Eigen::VectorXd bound = planted.Bound();
  ModalOptions options;
  options.max_order = max_order;
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(bound.size());
  int missed = 0, good = 0;
  double seconds = 0.0;
  for (int i = 0; i < draws; ++i) {
    Rng rng = Rng(5).Stream("draw", static_cast<std::uint64_t>(i));
    const std::vector<DecaySignal> signals = planted.Draw(rng);
    const double start = Seconds();
    const DecayFit fit = IdentifyModes(signals, options).decay;
    seconds += Seconds() - start;
    if (!fit.Usable() || fit.modes.size() != 3) {
      ++missed;
      continue;
    }
    ++good;
    for (Eigen::Index k = 0; k < 3; ++k) {
      const auto m = static_cast<std::size_t>(k);
      squares(2 * k) += std::pow(fit.modes[m].frequency - planted.modes[m].frequency, 2);
      squares(2 * k + 1) += std::pow(fit.modes[m].damping - planted.modes[m].damping, 2);
    }
  }
  const Eigen::ArrayXd over = (squares / std::max(1, good)).array().sqrt() / bound.array();
  fmt::print("| {:.0f} s, {} | {:.0f} dB | {} | {} of {} | {:.2f} to {:.2f} | {:.0f} |\n", duration,
             planted.t[0].size(), 20.0 * std::log10(ratio), max_order, missed, draws,
             over.minCoeff(), over.maxCoeff(), 1e3 * seconds / draws);
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  const int draws = argc > 1 ? std::atoi(argv[1]) : 100;
  fmt::print(
      "| record, samples a signal | weakest mode | orders to | missed | RMSE over bound | CPU ms "
      "|\n");
  fmt::print("|---|---|---|---|---|---|\n");
  for (const double duration : {2.0, 4.0, 8.0}) Row(duration, 10.0, 40, draws);
  for (const int order : {16, 24, 60}) Row(4.0, 10.0, order, draws);
  for (const double ratio : {2.0, 3.16, 100.0}) Row(4.0, ratio, 40, draws);
}
