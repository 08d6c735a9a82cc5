// What readings that scatter more than stated are called, and what is done about them.
#include <fmt/format.h>

#include <algorithm>

#include "base/text.h"
#include "measure/health.h"

namespace unfurl::measure {

std::vector<double> WideningsOf(const ScatterReport& scatter, std::size_t cells) {
  std::vector<double> out(cells, 1.0);
  for (std::size_t k = 0; k < scatter.cells.size(); ++k) out[k] = scatter.cells[k].factor;
  return out;
}

void AddWidenings(const ScatterReport& scatter, const MisfitReport& misfit, std::size_t cameras,
                  std::vector<Correction>* corrections) {
  std::erase_if(*corrections, [](const Correction& one) { return one.widen != 1.0; });
  if ((!scatter.wide && !misfit.wide) || cameras == 0) return;
  const std::size_t cells = std::max(scatter.cells.size(), misfit.wide ? misfit.factors.size() : 0);
  std::vector<double> factors = WideningsOf(scatter, cells);
  std::vector<double> widest(cameras, 1.0);  // of marks that are never lit alone
  for (std::size_t k = 0; k < cells; ++k) {
    if (misfit.wide) factors[k] *= misfit.factors[k];
    widest[k % cameras] = std::max(widest[k % cameras], factors[k]);
  }
  for (std::size_t c = 0; c < cameras; ++c) {
    const double widen = misfit.wide ? widest[c] : scatter.cameras[c].factor;
    corrections->push_back({.camera = static_cast<int>(c), .widen = widen});
  }
  for (std::size_t k = 0; k < cells; ++k) {
    corrections->push_back({.camera = static_cast<int>(k % cameras),
                            .widen = factors[k],
                            .mark = static_cast<int>(k / cameras)});
  }
}

namespace {

std::string WithSigma(const Scatter& one) {
  return fmt::format("{:.2f} +- {:.2f} times what is stated", one.factor, one.sigma);
}

// Those whose readings scatter more than stated beyond their own error; false: all do, or it cannot
// be told which.
bool NameOwners(const ScatterReport& scatter, std::span<const std::string> cameras,
                std::span<const std::string> marks, std::vector<std::string>* named) {
  const auto add = [&](const std::vector<Scatter>& those, const auto& name) {
    constexpr double kSure = 3.0;  // sigmas
    for (std::size_t k = 0; k < those.size(); ++k) {
      if (!(those[k].factor - 1.0 > kSure * those[k].sigma)) continue;
      named->push_back(name(k) + " scatter " + WithSigma(those[k]));
    }
    return !named->empty() && named->size() < those.size();
  };
  switch (scatter.owner) {
    case ScatterOwner::kCameras:
      return add(scatter.cameras, [&](std::size_t k) { return "camera " + cameras[k]; });
    case ScatterOwner::kMarks:
      return add(scatter.marks, [&](std::size_t k) { return "mark " + marks[k]; });
    case ScatterOwner::kCells:
      return add(scatter.cells, [&](std::size_t k) {
        return fmt::format("mark {} in camera {}", marks[k / cameras.size()],
                           cameras[k % cameras.size()]);
      });
    case ScatterOwner::kAll:
      break;
  }
  add(scatter.cameras, [&](std::size_t k) { return cameras[k]; });
  return false;
}

std::string UntoldMarks(const ScatterReport& scatter, std::span<const std::string> marks) {
  if (scatter.untold.empty()) return "";
  std::vector<std::string> names;
  for (const auto& [mark, why] : scatter.untold) {
    names.push_back(marks[static_cast<std::size_t>(mark)]);
  }
  return fmt::format("; of {} by themselves it cannot be told: {}", JoinWords(names),
                     scatter.untold.front().second);
}

}  // namespace

std::string Describe(const MisfitReport& misfit) {
  if (!misfit.wide) return "";
  return fmt::format(
      "readings depart by {:.2g} px from where the calibration puts them, for flashes on end and "
      "beyond their noise and its errors",
      misfit.all_px);
}

std::string DescribeWrong(std::span<const WrongReading> wrong,
                          std::span<const std::string> cameras) {
  if (wrong.empty()) return "";
  std::vector<std::string> counts;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const auto count = std::count_if(wrong.begin(), wrong.end(), [c](const WrongReading& one) {
      return one.camera == static_cast<int>(c);
    });
    if (count > 0) counts.push_back(fmt::format("{} of camera {}", count, cameras[c]));
  }
  return "readings depart from the course of their mark where no other camera vouches for them: " +
         JoinWords(counts);
}

std::string Describe(const ScatterReport& scatter, std::span<const std::string> cameras,
                     std::span<const std::string> marks) {
  if (!scatter.unknown.empty()) {
    return "whether readings scatter as stated cannot be told: " + scatter.unknown;
  }
  const std::string untold = UntoldMarks(scatter, marks);
  const std::string all = "readings scatter " + WithSigma(scatter.all);
  if (!scatter.wide) return all + untold;
  std::vector<std::string> named;
  if (NameOwners(scatter, cameras, marks, &named)) {
    constexpr std::size_t kMostNamed = 6;  // of more nobody reads; the file has them all
    const std::size_t more = named.size() - std::min(named.size(), kMostNamed);
    if (more > 0) {
      named.resize(kMostNamed);
      named.push_back(fmt::format("{} more", more));
    }
    return "readings of " + JoinWords(named) + untold;
  }
  // All of them do, or the record does not tell whose it is.
  return all + (named.empty() ? "; of which camera cannot be told" : "") + untold;
}

}  // namespace unfurl::measure
