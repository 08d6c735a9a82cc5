#include "correlate/compare/wrong_readings.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/count.h"
#include "base/fixed_number.h"
#include "base/number.h"
#include "base/text.h"
#include "correlate/align/far_samples.h"
#include "correlate/residual/channel.h"
#include "correlate/residual/row_layout.h"

namespace unfurl::correlate {

namespace {

constexpr std::size_t kNamed = 5;  // as many as a sentence bears

// What single readings leave of all, those put aside with them.
std::vector<ChannelGross> GrossAt(const SampledModel& reference, const Alignment& a,
                                  Observations all) {
  PutAside(std::vector<ChannelGross>(), &all);
  const Clock clock = a.at.clock();
  const Prediction prediction = reference.Evaluate({}, all.StampsAt(clock));
  const ResidualKind::Clocks clocks = ClocksOf(all, clock, clock);
  const RowLayout layout(all);
  Eigen::VectorXd residual = Eigen::VectorXd::Zero(layout.rows);
  for (std::size_t k = 0; k < all.others.size(); ++k) {
    const ResidualKind& kind = *all.others[k];
    const Eigen::Index n = kind.rows();
    const auto unknowns = static_cast<Eigen::Index>(kind.unknowns().size());
    ResidualKind::Rows rows{Eigen::VectorXd::Zero(n), Eigen::VectorXd::Zero(n),
                            Eigen::MatrixXd::Zero(n, unknowns)};
    kind.Evaluate(kind.NumbersOf(prediction), clocks, layout.OwnOf(k, a.at.own), &rows);
    residual.segment(layout.others[k], n) = rows.residual;
  }
  std::vector<ChannelGross> gross = FindChannelGross(all, residual);
  // Bursts are a difference between the two, which is what a comparison is for.
  std::erase_if(gross, [](const ChannelGross& g) { return g.errors.samples.empty(); });
  return gross;
}

}  // namespace

Alignment AlignWithoutGross(const SampledModel& reference, Observations* observations,
                            std::vector<ChannelGross>* gross) {
  *observations = Aside(*observations, FindFarReadings(*observations));
  Alignment a = Align(*observations, reference);
  if (!a.Usable()) return a;
  *gross = GrossAt(reference, a, *observations);
  PutAside(*gross, observations);
  return Align(*observations, reference);
}

std::vector<std::string> GrossWords(const Observations& observations,
                                    const std::vector<ChannelGross>& gross, const std::string& of) {
  std::vector<std::string> out;
  for (const ChannelGross& one : gross) {
    const auto* channel = dynamic_cast<const Channel*>(observations.others[one.kind].get());
    if (channel == nullptr || one.errors.samples.empty()) continue;
    std::vector<GrossSample> far = one.errors.samples;
    std::stable_sort(far.begin(), far.end(), [](const GrossSample& a, const GrossSample& b) {
      return a.sigmas > b.sigmas;
    });
    std::vector<std::string> names;
    for (std::size_t i = 0; i < std::min(kNamed, far.size()); ++i) {
      const ChannelRecord& r = channel->record();
      names.push_back(
          fmt::format("{} at {} s ({:.3g} sigma)",
                      Number(r.y(static_cast<Eigen::Index>(far[i].index))) + UnitAfter(r.unit),
                      FixedNumber(r.t[far[i].index]), far[i].sigmas));
    }
    out.push_back(fmt::format("Gross errors, which are put aside: {} of {} of {}{}: {}{}.",
                              far.size(), Counted(one.readings, "reading"), one.name, of,
                              far.size() > kNamed ? "the farthest are " : "", JoinWords(names)));
  }
  return out;
}

std::vector<std::string> TakeOutWrong(const std::string& name, const std::string& unit,
                                      const Readings& readings) {
  std::vector<std::string> out;
  auto y = [&] {
    return Eigen::Map<const Eigen::VectorXd>(readings.y->data(),
                                             static_cast<Eigen::Index>(readings.y->size()));
  };
  if (const std::vector<HeldRun> held = FindHeldRuns(*readings.t, y()); !held.empty()) {
    for (std::vector<double>* v : {readings.t, readings.y, readings.sigma}) LeaveOut(held, v);
    out.push_back(HeldWords(held, name, unit));
  }
  const std::vector<std::size_t> far = FindFarReadings(*readings.t, y());
  if (far.empty()) return out;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < std::min(kNamed, far.size()); ++i) {
    names.push_back(fmt::format("{}{} at {} s", Number((*readings.y)[far[i]]), UnitAfter(unit),
                                FixedNumber((*readings.t)[far[i]])));
  }
  out.push_back(fmt::format(
      "Of {} {} taken for gross and left out: {} further off from the readings beside {} than "
      "these from each other ({}{}).",
      name, Counted(far.size(), "reading") + (far.size() == 1 ? " is" : " are"),
      far.size() == 1 ? "it lies" : "they lie", far.size() == 1 ? "it" : "them",
      far.size() > kNamed ? "the first are " : "", JoinWords(names)));
  for (auto i = far.rbegin(); i != far.rend(); ++i) {
    for (std::vector<double>* v : {readings.t, readings.y, readings.sigma}) {
      if (!v->empty()) v->erase(v->begin() + static_cast<std::ptrdiff_t>(*i));
    }
  }
  return out;
}

}  // namespace unfurl::correlate
