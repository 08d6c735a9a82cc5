#include "study/design_planner.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "base/error.h"
#include "correlate/residual/channel.h"
#include "study/rungs.h"
#include "study/trial_observations.h"

namespace unfurl::study {

namespace {

// Samples of marks of a planned trial that are looked at, at most: their rows take some hundred
// bytes each for every unknown. Of a longer record every so many-th cycle is taken.
constexpr std::size_t kMostSamples = 300000;

}  // namespace

void Planner::TakeCycle(StudyDesign* out) {
  if (!options_.cycle.empty()) {
    line_ = 1.0 / options_.line_rate;
    first_ = record().Start();
    for (const std::string& slot : options_.cycle) {
      cycle_.push_back(slot == "dark" ? std::string() : slot);
      if (slot == "dark" || record().FindMark(slot) >= 0) continue;
      throw Error("the trial has no mark '" + slot + "'", "DesignOptions.cycle",
                  "name marks of the trial, or \"dark\"");
    }
  } else {
    const correlate::Strobe strobe = correlate::FindStrobe(record());
    out->no_cycle = strobe.why;
    line_ = strobe.line;
    first_ = strobe.first;
    cycle_ = strobe.slots;
  }
  out->line = line_;
  for (const std::string& slot : cycle_) out->cycle.push_back(slot.empty() ? "dark" : slot);
}

std::vector<correlate::PlannedMark> Planner::Marks(const std::vector<std::string>& names) const {
  std::vector<correlate::PlannedMark> out;
  const correlate::Observations& like = record();
  if (!strobed()) {
    std::size_t richest = 0;
    for (std::size_t m = 0; m < like.marks.size(); ++m) {
      if (like.marks[m].size() > like.marks[richest].size()) richest = m;
    }
    for (const std::string& name : names) {
      const int at = like.FindMark(name);
      const std::size_t from = at >= 0 ? static_cast<std::size_t>(at) : richest;
      out.push_back({name, like.marks[from].t, std::vector<int>(like.marks[from].size(), 0)});
    }
    return out;
  }
  const auto slots = static_cast<long>(cycle_.size());
  const auto from = static_cast<long>(std::ceil((like.Start() - first_) / line_ - 1e-6));
  const auto to = static_cast<long>(std::floor((like.End() - first_) / line_ + 1e-6));
  const auto samples = static_cast<std::size_t>(to - from + 1) * names.size();
  const auto every = static_cast<long>(1 + samples / kMostSamples);
  weight_ = static_cast<double>(every);
  correlate::PlannedMark mark;
  for (long k = from; k <= to; ++k) {
    if (((k - from) / slots) % every != 0) continue;
    mark.t.push_back(first_ + static_cast<double>(k) * line_);
    mark.slot.push_back(static_cast<int>(((k % slots) + slots) % slots));
  }
  for (const std::string& name : names) {
    mark.name = name;
    out.push_back(mark);
  }
  return out;
}

std::vector<correlate::ChannelRecord> Planner::ChannelsAtHand() const {
  std::vector<correlate::ChannelRecord> out;
  for (const auto& kind : fit_.result.trials[trial_].kinds) {
    const auto* channel = dynamic_cast<const correlate::Channel*>(kind.get());
    if (channel != nullptr) out.push_back(channel->record());
  }
  return out;
}

const correlate::Model& Planner::Model(const std::vector<std::string>& set) {
  const correlate::FitTrial& trial = fit_.problem().trials[trial_];
  if (set.empty()) return trial.rungs.empty() ? *trial.model : *trial.rungs.back().model;
  if (study_.command) {
    throw Error("a program's scene is not known", study_.command->where,
                "plan marks and settings with a scene, or switch them in studies of your own");
  }
  SceneModelOptions how;
  how.scene = study_.scene;
  how.set = study_.set;
  for (const data::StudyParameter& p : study_.parameters) how.keys.push_back(p.keys);
  const std::vector<std::string>& own = study_.trials[trial_].set;
  how.set.insert(how.set.end(), own.begin(), own.end());
  how.set.insert(how.set.end(), set.begin(), set.end());
  how.rtol = study_.rtol > 0.0 ? study_.rtol : fit_.binding->tolerance[trial_].rtol;
  const std::vector<double> theta = basis_.fit->Theta();
  auto model = std::make_unique<SceneModel>(how, theta);
  const std::vector<SceneRung> rungs = RungsOf(study_.fidelity, model->beams());
  if (!rungs.empty()) {
    how.set.insert(how.set.end(), rungs.back().set.begin(), rungs.back().set.end());
    model = std::make_unique<SceneModel>(how, theta);
  }
  models_.push_back(std::move(model));
  return *models_.back();
}

const std::vector<data::Quantity>* Planner::Quantities(const correlate::Model& model) const {
  const auto* scene = dynamic_cast<const SceneModel*>(&model);
  return scene != nullptr ? &scene->quantities() : nullptr;
}

correlate::Choice Planner::ChoiceOf(const std::vector<int>& cycle, std::size_t marks,
                                    std::vector<bool> instruments) const {
  correlate::Choice out;
  out.slots.resize(marks);
  out.instruments = std::move(instruments);
  for (std::size_t s = 0; s < cycle.size(); ++s) {
    if (cycle[s] >= 0) {
      out.slots[static_cast<std::size_t>(cycle[s])].push_back(static_cast<int>(s));
    }
  }
  return out;
}

std::vector<int> Planner::CycleNow(const std::vector<std::string>& names) const {
  std::vector<int> out;
  for (const std::string& slot : cycle_) {
    const auto at = std::find(names.begin(), names.end(), slot);
    out.push_back(at == names.end() ? -1 : static_cast<int>(at - names.begin()));
  }
  return out;
}

namespace {

void AddInstruments(const DesignOptions& options, const Planner& planner,
                    const std::vector<data::Quantity>* quantities, Stock* stock) {
  std::set<std::string> taken;
  for (const auto& c : stock->content.channels) taken.insert(c.name);
  const correlate::Observations& like = planner.record();
  for (const data::DesignChannel& c : options.candidates.channels) {
    if (!taken.insert(c.channel.name).second) {
      throw Error("the trial has a channel of that name", c.channel.at, "give it another name");
    }
    if (!c.channel.event.empty()) continue;
    std::string unit = c.channel.unit;
    for (std::size_t q = 0; unit.empty() && quantities != nullptr && q < quantities->size(); ++q) {
      if ((*quantities)[q].name == c.channel.quantity) unit = (*quantities)[q].units;
    }
    correlate::ChannelRecord r = InstrumentOf(c.channel, unit, quantities);
    const auto n = static_cast<std::size_t>((like.End() - like.Start()) * c.rate) + 1;
    if (n > kMostSamples) {
      throw Error(fmt::format("{} readings of one channel", n), c.channel.at,
                  fmt::format("plan with {} at most: lower the rate", kMostSamples));
    }
    // Over the record, by its own clock.
    for (std::size_t i = 0; i < n; ++i) {
      r.t.push_back(like.Start() + r.delay.mean + static_cast<double>(i) / c.rate);
    }
    r.sigma = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(n), c.channel.sigma);
    stock->content.channels.push_back(std::move(r));
  }
  std::size_t channel = stock->instruments_at_hand, switches = 0;
  for (const data::DesignChannel& c : options.candidates.channels) {
    stock->instruments.push_back(c.channel.name);
    if (c.channel.event.empty()) {
      stock->instrument_at.push_back(channel++);
    } else {
      stock->content.switches.push_back(
          {c.channel.name, c.channel.event, c.channel.joint, c.channel.sigma});
      stock->instrument_at.push_back(stock->content.channels.size() + switches++);
    }
  }
  stock->now.assign(stock->content.channels.size() + switches, false);
  std::fill_n(stock->now.begin(), stock->instruments_at_hand, true);
}

}  // namespace

Stock StockOf(const DesignOptions& options, const Planner& planner,
              const std::vector<data::Quantity>* quantities, bool candidates) {
  Stock out;
  for (const correlate::MarkSeries& m : planner.record().marks) out.marks.push_back(m.name);
  out.marks_at_hand = out.marks.size();
  for (const data::DesignMark& m : options.candidates.marks) {
    if (!candidates) break;
    if (out.marks_at_hand == 0) {
      throw Error("the trial at hand has no marks, so the errors of one are not known", m.where,
                  "leave it out, or plan with a study whose trial has marks");
    }
    if (std::find(out.marks.begin(), out.marks.end(), m.name) != out.marks.end()) {
      throw Error("there is a mark of that name", m.where, "give it another name");
    }
    out.marks.push_back(m.name);
  }
  out.content.marks = planner.Marks(out.marks);
  out.content.channels = planner.ChannelsAtHand();
  out.instruments_at_hand = out.content.channels.size();
  if (candidates) {
    AddInstruments(options, planner, quantities, &out);
  } else {
    out.now.assign(out.instruments_at_hand, true);
  }
  return out;
}

}  // namespace unfurl::study
