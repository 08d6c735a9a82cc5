#include "study/trial_observations.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "base/error.h"
#include "base/fixed_number.h"
#include "base/text.h"
#include "correlate/residual/channel.h"
#include "correlate/residual/timed_events.h"
#include "data/beside.h"
#include "data/channels.h"
#include "data/formats.h"
#include "data/tracks.h"
#include "data/units.h"

namespace unfurl::study {

namespace {

correlate::Prior PriorOf(const data::StudyKnowledge& from) {
  using Kind = data::StudyKnowledge::Kind;
  switch (from.kind) {
    case Kind::kFree:
      return correlate::Prior::Free();
    case Kind::kNormal:
      return correlate::Prior::Normal(from.mean, from.sigma);
    case Kind::kKnown:
      return correlate::Prior::Known(from.mean);
    case Kind::kUnsaid:
      break;
  }
  return {};
}

correlate::Placement PlacementOf(const data::StudyTrial& trial) {
  correlate::Placement out;
  out.offset = PriorOf(trial.offset);
  out.drift = PriorOf(trial.drift);
  data::StudyKnowledge frame;
  frame.kind = trial.frame.kind;
  out.frame.kind = PriorOf(frame).kind;
  out.frame.X_WM.linear() =
      RotationFromVector(Eigen::Map<const Eigen::Vector3d>(trial.frame.rotation.data()));
  out.frame.X_WM.translation() = Eigen::Map<const Eigen::Vector3d>(trial.frame.shift.data());
  out.frame.sigma_rotation = trial.frame.sigma_rotation;
  out.frame.sigma_shift = trial.frame.sigma_shift;
  return out;
}

}  // namespace

namespace {

// What is said of marks where there are none would do nothing, and its author thinks it does.
void RefuseWordsOnMarks(const data::StudyTrial& trial) {
  const std::pair<const char*, bool> said[] = {{"window", trial.window_low < trial.window_high},
                                               {"sigma", trial.sigma > 0.0},
                                               {"marks", !trial.marks.empty()},
                                               {"sigma_factor", !trial.sigma_factors.empty()}};
  for (const auto& [key, is] : said) {
    if (!is) continue;
    throw Error(fmt::format("'{}' is of the tracks, and this trial has none", key), trial.where,
                "leave it out; a channel has a window and a sigma of its own "
                "(trial.channel.NAME.window, sigma)");
  }
}

}  // namespace

correlate::Observations ReadTrial(const data::StudyTrial& trial, const std::string& path) {
  if (path.empty()) {
    if (trial.tracks.empty()) RefuseWordsOnMarks(trial);
    correlate::Observations out;
    out.placement = PlacementOf(trial);
    return out;
  }
  const data::Tracks tracks = data::ReadTracksAny(path, trial.sigma);
  if (tracks.smoothed) {
    throw Error("these tracks are smoothed: their errors are no longer independent", path,
                "fit to the tracks as reconstructed");
  }
  correlate::Window window;
  if (trial.window_low < trial.window_high) window = {trial.window_low, trial.window_high};
  correlate::Observations out = correlate::FromTracks(tracks, trial.marks, window);
  for (const auto& [mark, factor] : trial.sigma_factors) {
    const int m = out.FindMark(mark);
    if (m < 0) {
      throw Error("there is no mark '" + mark + "'", trial.where,
                  "the tracks have " + JoinWords(tracks.marks));
    }
    out.marks[static_cast<std::size_t>(m)].cov *= factor * factor;
  }
  if (out.size() == 0) {
    throw Error("no sample of these marks lies in the window", trial.where, "widen the window");
  }
  out.placement = PlacementOf(trial);
  return out;
}

namespace {

std::string QuantityRemedy(const std::string& nearest) {
  return nearest.empty() ? "name a column of a run, such as 'joint1.theta'"
                         : "did you mean '" + nearest + "'?";
}

}  // namespace

NoQuantity::NoQuantity(const data::StudyChannel& channel, const std::vector<std::string>& names)
    : Error(fmt::format("the scene has no quantity '{}'", channel.quantity), channel.at,
            QuantityRemedy(NearestName(channel.quantity, names))),
      channel_(channel.name),
      quantity_(channel.quantity) {}

namespace {

// The part of a channel that counts, in its own time.
void Cut(const data::StudyChannel& want, data::Channel* c) {
  if (!(want.window_low < want.window_high)) return;
  data::Channel out = *c;
  out.t.clear(), out.y.clear(), out.sigma.clear();
  for (std::size_t i = 0; i < c->t.size(); ++i) {
    if (c->t[i] < want.window_low || c->t[i] > want.window_high) continue;
    out.t.push_back(c->t[i]);
    out.y.push_back(c->y[i]);
    if (!c->sigma.empty()) out.sigma.push_back(c->sigma[i]);
  }
  *c = std::move(out);
}

// How many units of the readings one of the quantity's is; 1 where the instrument's gain says it.
double ScaleOf(const data::StudyChannel& want, const std::string& unit,
               const std::vector<data::Quantity>* quantities) {
  if (quantities == nullptr) return 1.0;
  std::vector<std::string> names;
  for (const data::Quantity& q : *quantities) {
    names.push_back(q.name);
    if (q.name != want.quantity) continue;
    const auto factor = data::UnitsPer(unit, q.units);
    if (factor) return *factor;
    if (want.gain.kind != data::StudyKnowledge::Kind::kUnsaid) return 1.0;
    throw Error(unit.empty() ? fmt::format("'{}' states no unit", want.column)
                             : fmt::format("'{}' is in {}, and {} in {}", want.column, unit, q.name,
                                           q.units),
                want.at,
                fmt::format("state its unit, or its gain (free, or mean and sigma) in {}/({})",
                            unit.empty() ? "its unit" : unit, q.units));
  }
  throw NoQuantity(want, names);
}

correlate::LowPass FilterOf(const data::StudyChannel::Filter& from) {
  using Kind = correlate::LowPass::Kind;
  correlate::LowPass out;
  if (from.kind == "butterworth") out.kind = Kind::kButterworth;
  if (from.kind == "bessel") out.kind = Kind::kBessel;
  if (from.kind == "average") out.kind = Kind::kAverage;
  out.order = from.order;
  out.cutoff = from.cutoff;
  out.width = from.width;
  return out;
}

}  // namespace

correlate::ChannelRecord InstrumentOf(const data::StudyChannel& want, const std::string& unit,
                                      const std::vector<data::Quantity>* quantities) {
  correlate::ChannelRecord r;
  r.name = want.name;
  r.quantity = want.quantity;
  r.unit = unit;
  r.scale = ScaleOf(want, unit, quantities);
  r.gain = PriorOf(want.gain);
  r.bias = PriorOf(want.bias);
  r.delay = PriorOf(want.delay);
  r.drift = PriorOf(want.drift);
  r.filter = FilterOf(want.filter);
  return r;
}

namespace {

correlate::ChannelRecord RecordOf(const data::StudyChannel& want, const data::Channel& c,
                                  const std::vector<data::Quantity>* quantities) {
  if (!want.unit.empty() && !c.unit.empty()) {
    const auto same = data::UnitsPer(want.unit, c.unit);
    if (!same || *same != 1.0) {
      throw Error(fmt::format("'{}' is in {} by its file", want.column, c.unit), want.at,
                  "leave `unit` out, or mend the file");
    }
  }
  correlate::ChannelRecord r =
      InstrumentOf(want, !want.unit.empty() ? want.unit : c.unit, quantities);
  r.t = c.t;
  const auto n = static_cast<Eigen::Index>(c.y.size());
  r.y = Eigen::Map<const Eigen::VectorXd>(c.y.data(), n);
  if (want.sigma > 0.0) {
    r.sigma = Eigen::VectorXd::Constant(n, want.sigma);
  } else if (!c.sigma.empty()) {
    r.sigma = Eigen::Map<const Eigen::VectorXd>(c.sigma.data(), n);
  }
  correlate::LeaveOutHeld(&r);
  r.resolution = want.resolution > 0.0 ? want.resolution : correlate::ResolutionOf(r.y);
  // What is less than the scatter of a step (uniform over it) does not have that in it.
  const double step = r.resolution / std::sqrt(12.0);
  for (double& sigma : r.sigma) {
    if (sigma < step) sigma = std::hypot(sigma, step);
  }
  return r;
}

// Reading before which a switch changes, and after which change it comes to rest: contacts bounce.
struct Switching {
  std::size_t first = 0, last = 0;
};

// Changes about half the range. Those that follow one another within `bounce` are one, and none
// where the level is afterwards what it was before.
std::vector<Switching> SwitchingsOf(const data::Channel& c, double half, double bounce) {
  std::vector<Switching> out;
  for (std::size_t i = 1; i < c.y.size(); ++i) {
    if ((c.y[i - 1] > half) == (c.y[i] > half)) continue;
    if (!out.empty() && c.t[i] - c.t[out.back().last] <= bounce) {
      out.back().last = i;
    } else {
      out.push_back({i, i});
    }
  }
  std::erase_if(
      out, [&](const Switching& s) { return (c.y[s.first - 1] > half) == (c.y[s.last] > half); });
  return out;
}

// Times at which a switch changes: between the two readings about half its range, uniform there.
std::vector<correlate::TimedEvent> EdgesOf(const data::StudyChannel& want, const data::Channel& c) {
  const auto [low, high] = std::minmax_element(c.y.begin(), c.y.end());
  std::vector<correlate::TimedEvent> out;
  if (c.y.empty() || *low == *high) {
    throw Error(fmt::format("the switch '{}' never changes", want.column), want.at,
                "leave it out, or widen its window");
  }
  const double half = 0.5 * (*low + *high);
  for (const Switching& s : SwitchingsOf(c, half, want.bounce)) {
    if ((c.y[s.last] > half) != want.rising) continue;
    const double before = c.t[s.first - 1], after = c.t[s.first];
    out.push_back({want.event, want.joint, static_cast<int>(out.size()) + 1,
                   0.5 * (before + after) - want.delay.mean, (after - before) / std::sqrt(12.0)});
  }
  if (out.empty()) {
    throw Error(fmt::format("the switch '{}' has no {} edge", want.column,
                            want.rising ? "rising" : "falling"),
                want.at, "say edge = \"rising\" or \"falling\"");
  }
  if (want.count > static_cast<int>(out.size())) {
    throw Error(fmt::format("the switch '{}' has {} {} edges", want.column, out.size(),
                            want.rising ? "rising" : "falling"),
                want.at, "give the number of one of them (count)");
  }
  if (want.count > 0) out = {out[static_cast<std::size_t>(want.count - 1)]};
  return out;
}

}  // namespace

void AddChannels(const data::StudyTrial& trial, const std::vector<data::Quantity>* quantities,
                 correlate::Observations* observations) {
  std::map<std::string, std::vector<data::Channel>> files;  // each is read once
  std::vector<correlate::TimedEvent> events;
  for (const data::StudyChannel& want : trial.channels) {
    const auto [file, fresh] = files.try_emplace(want.file);
    if (fresh) {
      data::RequireFile(want.file, want.at);
      file->second = data::ReadChannels(want.file);
    }
    data::Channel c = data::FindChannel(file->second, want.column, want.at);
    Cut(want, &c);
    if (want.event.empty()) {
      observations->others.push_back(
          std::make_shared<correlate::Channel>(RecordOf(want, c, quantities), want.at));
    } else {
      const auto edges = EdgesOf(want, c);
      events.insert(events.end(), edges.begin(), edges.end());
    }
  }
  for (const data::StudyEvent& e : trial.events) {
    if (e.time < observations->Start() || e.time > observations->End()) {
      throw Error(
          fmt::format("{} s lies outside of the record, {} to {} s", e.time,
                      FixedNumber(observations->Start(), 3), FixedNumber(observations->End(), 3)),
          e.at, "give the time on the record's clock");
    }
    events.push_back({e.kind, e.where, e.count, e.time, e.sigma});
  }
  if (!events.empty()) {
    observations->others.push_back(std::make_shared<correlate::TimedEvents>(std::move(events)));
  }
}

}  // namespace unfurl::study
