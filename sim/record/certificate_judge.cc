// What a certificate leaves unknown.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "sim/record/certificate.h"

namespace unfurl::sim {
namespace {

// Whether one is NAME.x and the other NAME.y.
bool IsOtherCoordinate(const std::string& name, const std::string& other) {
  const std::size_t dot = name.rfind('.');
  if (dot == std::string::npos || other.compare(0, dot + 1, name, 0, dot + 1) != 0) return false;
  const std::string_view a = std::string_view(name).substr(dot + 1),
                         b = std::string_view(other).substr(dot + 1);
  return (a == "x" && b == "y") || (a == "y" && b == "x");
}

bool IsPlace(const std::string& units) { return units == "m" || units == "rad"; }

// What the integration lost is an error itself, and has none.
bool IsResidual(const std::string& name) {
  return name == "energy.residual" || name.starts_with("constraint.");
}

}  // namespace

bool Certificate::Named(const std::string& name) const {
  return std::find(names_.begin(), names_.end(), name) != names_.end();
}

// The largest of the run's loads, which is what all of them are rounded from.
double Certificate::LoadScale(const char* units, const SimulateReport& run) const {
  const auto largest = [](const std::vector<double>& peaks) {
    return peaks.empty() ? 0.0 : *std::max_element(peaks.begin(), peaks.end());
  };
  const double force = largest(run.peak_pin_force);
  return std::string_view(units) == "N" ? force
                                        : std::max(largest(run.peak_moment), force * length_);
}

// What a quantity may do and be called zero: speeds that move nothing by ten tolerances in the
// run's time, loads of which the largest is ten tolerances' fraction.
double Certificate::LeastOf(const data::Quantity& quantity, const SimulateReport& run) const {
  const struct {
    const char* units;
    double size;
  } sizes[] = {{"m", length_},
               {"m/s", length_ / duration_},
               {"rad/s", 1.0 / duration_},
               {"m/s^2", length_ / duration_ / duration_},
               {"N", LoadScale("N", run)},
               {"N m", LoadScale("N m", run)},
               {"J", LoadScale("N m", run)},
               {"1/m", 1.0 / length_}};
  for (const auto& [units, size] : sizes) {
    if (quantity.units == units) return promised_ * size;
  }
  return promised_;  // angles, strains
}

void Certificate::JudgePlaces(std::vector<Unknown>* out) const {
  const std::vector<Line> lines = Lines();
  for (const Line& line : lines) {
    if (!IsPlace(line.units) || IsResidual(line.name)) continue;
    double size = std::max(line.range, LeastOf({line.name, line.units, {}}, {}));
    for (const Line& other : lines) {
      if (IsOtherCoordinate(line.name, other.name)) size = std::max(size, other.range);
    }
    const double error = line.time + line.mesh;
    if (!(error > size)) continue;
    Unknown unknown{line.name, {}, {}, line.mesh > line.time, true, error / size};
    unknown.text = fmt::format("{} uncertain by {:.2g} {}, {:.0f}% of all that it does", line.name,
                               error, line.units, 100.0 * unknown.part);
    out->push_back(unknown);
  }
}

void Certificate::JudgeInTime(const SimulateReport& run, std::vector<Unknown>* out) const {
  const auto samples = static_cast<double>(samples_);
  for (std::size_t i = 0; i < certified_.size() && samples_ > 0; ++i) {
    const data::Quantity& q = certified_[i];
    if (IsPlace(q.units) || IsResidual(q.name) || i >= column_.size() || column_[i] < 0) continue;
    const Moments& moments = moments_[i];
    std::vector<double> errors;  // by companion, root mean square
    for (const double sum : moments.errors) errors.push_back(std::sqrt(sum / samples));
    errors.resize(2, 0.0);
    const double size = std::max(
        {std::sqrt(moments.squares / samples), LeastOf(q, run), promised_ * moments.largest});
    const double error = errors[0] + errors[1];
    if (!(error > size)) continue;
    Unknown unknown{q.name, {}, {}, errors[1] > errors[0], Named(q.name), error / size};
    unknown.text =
        fmt::format("{} uncertain by {:.2g} {} in the mean, {:.0f}% of what it varies by", q.name,
                    error, q.units, 100.0 * unknown.part);
    out->push_back(unknown);
  }
}

void Certificate::JudgeLoads(const SimulateReport& run, std::vector<Unknown>* out) const {
  const std::vector<Line> lines = LoadLines(run);
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const Line& line = lines[k];
    const double size = std::max(line.range, promised_ * LoadScale(line.units.c_str(), run));
    const double error = line.time + line.mesh;
    const bool unbounded = !loads_[k].contact && run.PinForceUnknown(loads_[k].number);
    if (!(error > size) && !unbounded) continue;
    Unknown unknown{line.name,   {}, {}, line.mesh > line.time, Named(loads_[k].in_time),
                    error / size};
    unknown.text = fmt::format("{} uncertain by {:.2g} {}, {:.0f}% of it", line.name, error,
                               line.units, 100.0 * unknown.part);
    if (unbounded && !(error > size)) {
      unknown.part = 1.0;
      unknown.text = line.name + " without a bound";
    }
    out->push_back(unknown);
  }
}

std::vector<Certificate::Unknown> Certificate::Unknowns(const SimulateReport& run) const {
  std::vector<Unknown> out;
  if (companions_.empty()) return out;
  JudgePlaces(&out);
  JudgeInTime(run, &out);
  JudgeLoads(run, &out);
  for (Unknown& unknown : out) {
    unknown.remedy = unknown.mesh ? "use more segments or a higher order" : "use a smaller rtol";
    if (!unknown.mesh && run.near_dependence > 0) {
      unknown.remedy +=
          "; where constraints come to depend on one another, as at a dead centre, "
          "none may determine forces";
    }
  }
  std::stable_sort(out.begin(), out.end(),
                   [](const Unknown& a, const Unknown& b) { return a.part > b.part; });
  return out;
}

std::string Certificate::Doubt(const SimulateReport& run) const {
  for (const Unknown& unknown : Unknowns(run)) {
    if (!unknown.decides) continue;
    return fmt::format("the {} leaves {}; {}", unknown.mesh ? "mesh" : "tolerance", unknown.text,
                       unknown.remedy);
  }
  return {};
}

std::string Certificate::Warning(const SimulateReport& run) const {
  std::vector<Unknown> others = Unknowns(run);
  std::erase_if(others, [](const Unknown& unknown) { return unknown.decides; });
  if (others.empty()) return {};
  const Unknown& worst = others.front();
  std::string more;
  if (others.size() > 1) more = fmt::format(" (and of {} more than all of it)", others.size() - 1);
  return fmt::format("not known: the {} leaves {}{}; {}", worst.mesh ? "mesh" : "tolerance",
                     worst.text, more, worst.remedy);
}

}  // namespace unfurl::sim
