#include <fmt/format.h>

#include <cmath>

#include "correlate/residual/channel.h"

namespace unfurl::correlate {

std::vector<std::string> Channel::Words(const Eigen::VectorXd& numbers, const Clocks& clocks,
                                        const Eigen::VectorXd& unknowns,
                                        const std::string& of) const {
  const Rows rows = RowsAt(numbers, clocks, unknowns);
  const Eigen::Index n = record_.y.size();
  const std::string head = fmt::format("Channel {} ({}){}", record_.name, record_.quantity, of);
  if (rows.known == 0) return {head + ": the model has nothing at the times of its readings."};
  double squares = 0.0, sigmas = 0.0, mean = 0.0, motion = 0.0;
  for (Eigen::Index i = 0; i < n; ++i) {
    if (rows.residual(i) == 0.0) continue;
    squares += std::pow(rows.residual(i) * record_.sigma(i), 2);
    sigmas += rows.residual(i) * rows.residual(i);
    mean += record_.y(i) / static_cast<double>(rows.known);
  }
  for (Eigen::Index i = 0; i < n; ++i) {
    if (rows.residual(i) != 0.0) motion += std::pow(record_.y(i) - mean, 2);
  }
  const double known = static_cast<double>(rows.known);
  std::string text = fmt::format("{}: {} readings, RMS residual {:.3g} {}", head, rows.known,
                                 std::sqrt(squares / known), record_.unit);
  const double of_sigma = std::sqrt(sigmas / known);
  const double noise = NoiseInUse(of_sigma);
  if (has_sigma_) {
    text += fmt::format(" ({:.2g} of its sigma)", of_sigma);
  } else if (noise > of_sigma) {
    text += fmt::format(
        ", less than the tolerance of a simulation, {:.2g} {}, which is taken since no sigma was "
        "stated",
        noise * record_.sigma.mean(), record_.unit);
  } else {
    text += ", which is taken for its noise since none was stated";
  }
  if (motion > 0.0) {
    text +=
        fmt::format("; the model explains {:.5g}% of its motion", 100.0 * (1.0 - squares / motion));
  }
  const double gain = ValuesOf(unknowns).gain;
  if (record_.gain.kind == Foreknowledge::kFree && gain * record_.scale < 0.0) {
    text += fmt::format(
        "; its gain came out negative ({:.3g}): its axis points the other way, or the record "
        "begins with a swing to the other side. Say which by trial.channel.{}.gain, or by "
        "trial.offset",
        gain, record_.name);
  }
  if (clipped_ > 0) {
    auto end = [&](double limit) {
      return std::isfinite(limit) ? fmt::format("{:.6g}", limit) : std::string("none");
    };
    text += fmt::format(
        "; {} of {} readings lie at the ends of its range ({} to {} {}): each counts as \"this or "
        "beyond\"",
        clipped_, n, end(record_.lowest), end(record_.highest), record_.unit);
  }
  std::vector<std::string> out = {text + "."};
  if (!record_.held.empty())
    out.push_back(HeldWords(record_.held, record_.name + of, record_.unit));
  return out;
}

}  // namespace unfurl::correlate
