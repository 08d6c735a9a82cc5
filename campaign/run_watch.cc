#include "campaign/run_watch.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "base/error.h"
#include "base/progress.h"
#include "base/text.h"
#include "sim/methods/events.h"

namespace unfurl::campaign {

namespace {

using data::CampaignResponse;
using Source = CampaignResponse::Source;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::vector<std::string> WantedNames(const std::vector<CampaignResponse>& responses) {
  std::set<std::string> names;
  for (const CampaignResponse& r : responses) {
    if (r.source == Source::kQuantity) names.insert(r.quantity);
  }
  return {names.begin(), names.end()};
}

// The nearest name, or what there is to look at.
std::string Remedy(const std::string& name, const std::vector<std::string>& known) {
  const std::string near = NearestName(name, known);
  if (!near.empty()) return "did you mean '" + near + "'?";
  return known.empty() ? "the scene has none" : "the scene has " + JoinWords(known);
}

void CheckQuantity(const CampaignResponse& r, const std::vector<data::Quantity>& quantities) {
  std::vector<std::string> known;
  known.reserve(quantities.size());
  for (const data::Quantity& q : quantities) known.push_back(q.name);
  if (std::find(known.begin(), known.end(), r.quantity) != known.end()) return;
  const std::string near = NearestName(r.quantity, known);
  throw Error("the run has no quantity '" + r.quantity + "'", r.where + ".quantity",
              near.empty() ? "`unfurl simulate` and `unfurl info RUN.h5` list them"
                           : "did you mean '" + near + "'?");
}

}  // namespace

RunWatch::RunWatch(const sim::Model& model, const std::vector<CampaignResponse>& responses)
    : model_(model), responses_(responses), tallies_(responses.size()), counts_(responses.size()) {
  Observe(model);
  for (std::size_t k = 0; k < responses.size(); ++k) {
    const CampaignResponse& r = responses[k];
    if (r.source == Source::kQuantity) {
      const auto& all = observables_->quantities();
      CheckQuantity(r, all);
      const auto found = std::find_if(
          all.begin(), all.end(), [&](const data::Quantity& q) { return q.name == r.quantity; });
      tallies_[k].column = static_cast<std::size_t>(found - all.begin());
    } else if (r.source == Source::kEvent) {
      CheckPlace(r);
      counts_[k].all = r.joint.empty() && r.event == "latch";
      counts_[k].where.assign(static_cast<std::size_t>(model.latches.count()), 0);
    }
  }
}

void RunWatch::Observe(const sim::Model& model) {
  const std::vector<std::string> wanted = WantedNames(responses_);
  if (wanted.empty()) return;
  try {
    observables_.emplace(model, wanted);
  } catch (const Error&) {
    const std::vector<data::Quantity> all = sim::Observables(model).quantities();
    for (const CampaignResponse& r : responses_) {
      if (r.source == Source::kQuantity) CheckQuantity(r, all);
    }
    throw;
  }
}

void RunWatch::CheckPlace(const CampaignResponse& r) const {
  std::vector<std::string> known;
  if (r.event == "watch") {
    for (int w = 0; w < model_.watches.count(); ++w) known.push_back(model_.watches.at(w).name);
  } else {
    for (const auto& joint : model_.joints) {
      if (joint.latch >= 0) known.push_back(joint.name);
    }
  }
  if (known.empty()) {
    throw Error(r.event == "watch" ? "the scene has no watches" : "the scene has no latches",
                r.where + ".event", "leave the response out");
  }
  if (r.joint.empty() || std::find(known.begin(), known.end(), r.joint) != known.end()) return;
  throw Error("no such event happens at '" + r.joint + "'", r.where + ".where",
              Remedy(r.joint, known));
}

void RunWatch::OnSample(double t, double* state, const std::vector<sim::LatchMode>& modes) {
  if (!observables_) return;
  const std::vector<double>& row = observables_->Row(t, state, modes);
  for (std::size_t k = 0; k < responses_.size(); ++k) {
    if (responses_[k].source == Source::kQuantity) {
      AddSample(responses_[k], t, row[tallies_[k].column], &tallies_[k]);
    }
  }
}

void RunWatch::AddSample(const CampaignResponse& r, double t, double value, Tally* tally) {
  Tally& a = *tally;
  if (r.of == "at") {
    // Linear between the two samples around it.
    if (!a.known_at && t >= r.at) {
      const double h = t - a.last_t;
      a.at = a.count == 0 || h <= 0.0 ? value : a.last + (value - a.last) * (r.at - a.last_t) / h;
      a.known_at = a.count > 0 || t == r.at;
    }
  } else if (t < r.from || t > r.to) {
    return;
  } else if (a.count > 0) {
    const double h = t - a.last_t;
    a.integral += 0.5 * h * (a.last + value);
    // Of the straight line between the samples.
    a.square += h * (a.last * a.last + a.last * value + value * value) / 3.0;
    a.span += h;
  }
  a.low = a.count == 0 ? value : std::min(a.low, value);
  a.high = a.count == 0 ? value : std::max(a.high, value);
  a.last_t = t;
  a.last = value;
  ++a.count;
}

void RunWatch::OnEvent(const sim::Event& event) {
  for (std::size_t k = 0; k < responses_.size(); ++k) {
    const CampaignResponse& r = responses_[k];
    if (r.source != Source::kEvent || r.event != sim::EventName(event.kind)) continue;
    if (!r.joint.empty() && r.joint != sim::PlaceOf(model_, event)) continue;
    if (event.t < r.from || event.t > r.to) continue;
    Count& count = counts_[k];
    if (count.all && r.of != "number") {
      // Each latch once: the structure is deployed with the last of them.
      int& seen = count.where[static_cast<std::size_t>(event.latch)];
      if (seen++ > 0) continue;
    }
    ++count.number;
    const int asked = count.all ? model_.latches.count() : r.count;
    if (count.number == asked) count.time = event.t;
  }
}

void RunWatch::OnProgress(double /*fraction*/) { ThrowIfInterrupted(); }

double RunWatch::Of(const CampaignResponse& r, const Tally& a) const {
  if (r.of == "at") return a.known_at ? a.at : kNone;
  if (a.count == 0) return kNone;
  if (r.of == "largest") return a.high;
  if (r.of == "smallest") return a.low;
  if (r.of == "peak") return std::max(std::abs(a.low), std::abs(a.high));
  if (r.of == "range") return a.high - a.low;
  if (r.of == "final") return a.last;
  if (a.span <= 0.0) return r.of == "mean" ? a.last : std::abs(a.last);
  return r.of == "mean" ? a.integral / a.span : std::sqrt(std::max(a.square / a.span, 0.0));
}

double RunWatch::Of(const CampaignResponse& r, const Count& count) const {
  if (r.of == "number") return static_cast<double>(count.number);
  const int asked = count.all ? model_.latches.count() : r.count;
  const bool happened = count.number >= asked;
  if (r.of == "happened") return happened ? 1.0 : 0.0;
  return happened ? count.time : kNone;
}

void RunWatch::Finish(std::span<double> responses) const {
  for (std::size_t k = 0; k < responses_.size(); ++k) {
    const CampaignResponse& r = responses_[k];
    responses[k] = r.source == Source::kQuantity ? Of(r, tallies_[k])
                   : r.source == Source::kEvent  ? Of(r, counts_[k])
                                                 : kNone;
  }
}

}  // namespace unfurl::campaign
