#include "study/instruments_apart.h"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <utility>

#include "base/number.h"
#include "base/text.h"
#include "correlate/align/nuisance.h"
#include "correlate/residual/channel.h"

namespace unfurl::study {

namespace {

using correlate::Channel;
using correlate::ChannelRecord;
using correlate::Prior;

// What may be set free of an instrument.
struct ChannelNumber {
  Prior ChannelRecord::*said;
  const char* name;
  double unsaid;  // what it is where nothing is said
};
constexpr ChannelNumber kNumbers[] = {{&ChannelRecord::gain, "gain", 1.0},
                                      {&ChannelRecord::bias, "bias", 0.0},
                                      {&ChannelRecord::delay, "delay", 0.0}};

// What it is without one: what is said, or what is taken where nothing is.
double Taken(const ChannelRecord& record, const ChannelNumber& number) {
  const Prior& said = record.*number.said;
  return said.Told() ? said.mean : number.unsaid;
}

// The channel with one number of which nothing is said; null: it is fitted already.
std::shared_ptr<const correlate::ResidualKind> With(const Channel& channel,
                                                    const ChannelNumber& number) {
  const correlate::Foreknowledge kind = (channel.record().*number.said).kind;
  if (kind == correlate::Foreknowledge::kFree || kind == correlate::Foreknowledge::kNormal) {
    return nullptr;
  }
  ChannelRecord record = channel.record();
  record.*number.said = Prior::Free();
  if (!channel.has_sigma()) record.sigma.resize(0);
  return std::make_shared<Channel>(std::move(record));
}

// "gain of enc": its value with its standard error; empty: it was not fitted.
std::string ValueOf(const correlate::TrialResult& t, const std::string& name,
                    const std::string& unit) {
  for (std::size_t i = 0; i < t.nuisances.size(); ++i) {
    if (t.nuisances[i].Name() != name) continue;
    return NumberWithError(correlate::ValueOf(t.nuisances[i], t.registration),
                           t.nuisance_sigma(static_cast<Eigen::Index>(i))) +
           UnitAfter(unit);
  }
  return "";
}

std::string UnitOf(const ChannelRecord& record, const ChannelNumber& number) {
  if (number.said == &ChannelRecord::bias) return record.unit;
  return number.said == &ChannelRecord::delay ? "s" : "";
}

}  // namespace

TrialsApart FindInstrumentsApart(const correlate::FitProblem& problem,
                                 const correlate::FitOptions& options,
                                 const correlate::FitResult& r) {
  TrialsApart out;
  if (!r.Usable() || ExplainsAll(r)) return out;
  const correlate::FitOptions how = NoSearch(options);
  std::vector<std::string> which;
  for (std::size_t t = 0; t < problem.trials.size(); ++t) {
    const correlate::Observations& all = *problem.trials[t].observations;
    for (std::size_t k = 0; k < all.others.size(); ++k) {
      const auto* channel = dynamic_cast<const Channel*>(all.others[k].get());
      if (channel == nullptr) continue;
      for (const ChannelNumber& number : kNumbers) {
        correlate::Observations freed = all;
        freed.others[k] = With(*channel, number);
        if (freed.others[k] == nullptr) continue;
        correlate::FitProblem other = FromEstimate(problem, r);
        other.trials[t].observations = &freed;
        const correlate::FitResult there = correlate::Fit(other, how);
        if (!ExplainsAll(there)) continue;
        const ChannelRecord& record = channel->record();
        const std::string name = fmt::format("{} of {}", number.name, record.name);
        which.push_back(name);
        out.reasons.push_back(fmt::format(
            "With a {}{} of {} in place of {:.6g} the data are explained ({}). Look at that "
            "instrument, or let the fit find it (trial.channel.{}.{} = \"free\").",
            name, problem.trials.size() > 1 ? " in " + problem.trials[t].name : "",
            ValueOf(there.trials[t], name, UnitOf(record, number)), Taken(record, number),
            ValuesOf(problem, there), record.name, number.name));
      }
    }
  }
  if (!which.empty()) {
    out.verdict = fmt::format("the data with the {} that the study says", JoinWords(which));
  }
  return out;
}

}  // namespace unfurl::study
