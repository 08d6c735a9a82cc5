#include "study/channel_unit_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numbers>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/statistics.h"
#include "correlate/residual/channel.h"
#include "correlate/sampled_model.h"

namespace unfurl::study {

namespace {

// How widely a signal moves, and how long it takes for that.
struct Pace {
  double spread = 0.0;  // between its 5% and 95% quantiles [unit]
  double time = 0.0;    // spread over a high quantile of its rate [s]
};

// 0 where nothing moves, or noise of `sigma` is too large to tell.
Pace PaceOf(const std::vector<double>& t, const Eigen::VectorXd& y, double sigma) {
  constexpr double kLow = 0.05, kHigh = 0.95;  // quantiles: gross errors and bursts are few
  constexpr double kRate = 0.9;                // of the rates: rest may take most of a record
  constexpr double kClear = 10.0;              // sigmas of noise that are no motion
  Pace out;
  const std::vector<double> values(y.begin(), y.end());
  const std::size_t n = values.size();
  const double spread = Quantile(values, kHigh) - Quantile(values, kLow);
  if (n < 4 || !(spread > kClear * sigma)) return out;
  // The shortest lag over which the motion is more than noise.
  for (std::size_t lag = 1; lag < n / 2; lag *= 2) {
    std::vector<double> step, rate;
    for (std::size_t i = lag; i < n; i += lag) {
      step.push_back(std::abs(values[i] - values[i - lag]));
      rate.push_back(step.back() / (t[i] - t[i - lag]));
    }
    const double moved = Quantile(step, kRate);
    if (!(moved > kClear * sigma) || !(moved > 0.0)) continue;
    if (moved > 0.5 * spread) return out;  // so few readings to a swing tell no rate
    out.spread = spread;
    out.time = spread / Quantile(rate, kRate);
    return out;
  }
  return out;
}

// A unit that one is taken for, by the ratio of numbers.
struct Mistaken {
  double ratio;
  double within;  // factor to either side
  const char* words;
};
// Nearer to them than to one by far, and not so near that a start that is off could do it: a factor
// of three in size or pace is no start. Degrees and minutes lie nearer to one.
constexpr double kThousand = 3.0, kSixty = 2.0;

// A record's time or spread over the scene's; null: alike, or nothing known.
const Mistaken* Find(std::span<const Mistaken> all, double ratio) {
  for (const Mistaken& m : all) {
    if (ratio > m.ratio / m.within && ratio < m.ratio * m.within) return &m;
  }
  return nullptr;
}

constexpr Mistaken kTimes[] = {
    {1e6, kThousand, "are they in microseconds?"},
    {1e3, kThousand, "are they in milliseconds?"},
    {1.0 / 60.0, kSixty, "are they in minutes?"},
    {1.0 / 3600.0, kThousand, "are they in hours?"},
};
constexpr double kDegree = 180.0 / std::numbers::pi;  // of a radian
constexpr Mistaken kAngles[] = {
    {kDegree, kSixty, "are they in degrees?"},
    {1.0 / kDegree, kSixty, "are they in radians?"},
    {1e3, kThousand, "are they in thousandths of it?"},
};
constexpr Mistaken kOthers[] = {
    {1e3, kThousand, "are they in thousandths of it (mm for m)?"},
    {1e-3, kThousand, "are they in thousands of it (m for mm)?"},
};

bool OfAngle(const std::string& unit) {
  return unit.find("rad") != std::string::npos || unit.find("deg") != std::string::npos;
}

struct ScaleDoubt {
  bool times = false;  // else readings
  double ratio = 1.0;
  const Mistaken* unit = nullptr;
};

// What one channel's record has over what the scene does; no ratio: cannot be told.
struct Ratios {
  std::optional<double> time, spread;
};

class Comparer {
 public:
  Comparer(const SceneModel& model, const correlate::Channel& channel)
      : model_(model), channel_(channel.record()) {
    constexpr int kPoints = 2000;  // of the scene's duration
    for (int i = 0; i <= kPoints; ++i) t_.push_back(model.duration() * i / kPoints);
    record_ = PaceOf(channel_.t, channel_.y, correlate::NoiseOf(channel_.y));
  }
  Ratios At(std::span<const double> theta) const {
    Ratios out;
    if (!(record_.spread > 0.0)) return out;
    correlate::Stamps stamps;
    stamps.quantities.push_back({channel_.name, channel_.quantity, t_});
    const correlate::Prediction run = model_.Evaluate(theta, stamps);
    if (run.status != correlate::ModelStatus::kGood || run.quantities.empty()) return out;
    std::vector<double> t, y;
    for (std::size_t i = 0; i < t_.size(); ++i) {
      const double value = run.quantities[0].values(static_cast<Eigen::Index>(i));
      if (!std::isfinite(value)) continue;
      t.push_back(t_[i]);
      y.push_back(channel_.scale * value);
    }
    const Pace scene = PaceOf(
        t, Eigen::Map<const Eigen::VectorXd>(y.data(), static_cast<Eigen::Index>(y.size())), 0.0);
    if (!(scene.spread > 0.0)) return out;
    out.time = record_.time / scene.time;
    if (channel_.gain.kind == correlate::Foreknowledge::kUnsaid)
      out.spread = record_.spread / scene.spread;
    return out;
  }
  std::optional<ScaleDoubt> DoubtAt(std::span<const double> theta) const {
    const Ratios ratios = At(theta);
    if (!ratios.time) return {};
    if (const Mistaken* m = Find(kTimes, *ratios.time)) return ScaleDoubt{true, *ratios.time, m};
    if (!ratios.spread) return {};
    const Mistaken* m =
        OfAngle(channel_.unit) ? Find(kAngles, *ratios.spread) : Find(kOthers, *ratios.spread);
    if (m == nullptr) return {};
    return ScaleDoubt{false, *ratios.spread, m};
  }
  // Whether a scene with these values is so much nearer that it is no question of units.
  bool Explains(const ScaleDoubt& doubt, std::span<const double> theta) const {
    const Ratios ratios = At(theta);
    const std::optional<double>& own = doubt.times ? ratios.time : ratios.spread;
    if (!own || !(*own > 0.0)) return false;
    return std::abs(std::log(*own)) < 0.5 * std::abs(std::log(doubt.unit->ratio));
  }

 private:
  const SceneModel& model_;
  const correlate::ChannelRecord& channel_;
  std::vector<double> t_;
  Pace record_;
};

[[noreturn]] void Refuse(const ScaleDoubt& doubt, const correlate::ChannelRecord& channel,
                         const std::string& where) {
  if (doubt.times) {
    throw Error(fmt::format("the times of channel '{}' are {:.3g} times what the scene's motion "
                            "takes: {}",
                            channel.name, doubt.ratio, doubt.unit->words),
                where,
                "name the unit of its times in the file's header, as in 't [ms]', or convert them");
  }
  throw Error(
      fmt::format("the readings of channel '{}' move {:.3g} times as far as the scene does "
                  "in {}: {}",
                  channel.name, doubt.ratio, channel.unit, doubt.unit->words),
      where,
      "state its unit, as in unit = \"deg\", or its gain, gain = \"free\" where it is to be "
      "found");
}

}  // namespace

void RefuseOtherChannelUnits(const data::StudyTrial& trial,
                             const std::vector<data::StudyParameter>& parameters,
                             const correlate::Observations& record, const SceneModel& model,
                             std::span<const double> theta) {
  for (const auto& kind : record.others) {
    const auto* channel = dynamic_cast<const correlate::Channel*>(kind.get());
    if (channel == nullptr) continue;
    const Comparer comparer(model, *channel);
    const std::optional<ScaleDoubt> doubt = comparer.DoubtAt(theta);
    if (!doubt) continue;
    bool explained = false;
    for (std::size_t j = 0; j < parameters.size() && !explained; ++j) {
      std::vector<double> moved(theta.begin(), theta.end());
      for (const double bound : {parameters[j].low, parameters[j].high}) {
        moved[j] = bound;
        explained = explained || (std::isfinite(bound) && comparer.Explains(*doubt, moved));
      }
    }
    if (explained) continue;
    const auto own = std::find_if(trial.channels.begin(), trial.channels.end(),
                                  [&](const auto& c) { return c.name == channel->record().name; });
    Refuse(*doubt, channel->record(), own != trial.channels.end() ? own->at : trial.where);
  }
}

}  // namespace unfurl::study
