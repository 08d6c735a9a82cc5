#pragma once

#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "base/random.h"
#include "correlate/fit/fit.h"
#include "correlate/residual/channel.h"
#include "correlate/residual/timed_events.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/two_link.h"

namespace unfurl::correlate {

// The two-link arm with what instruments on its first link see: an encoder, a gyroscope, an
// accelerometer (which nothing is known of before the release), and a switch at each passing.
class Instrumented : public TwoLink {
 public:
  static double Quantity(std::span<const double> theta, const std::string& name, double t) {
    if (t < 0.0) return name == "first.angle" ? 1.2 : name == "first.rate" ? 0.0 : std::nan("");
    const double w = 2.0 * std::numbers::pi * theta[0], d = theta[1];
    const double e = 1.2 * std::exp(-d * t), c = std::cos(w * t), s = std::sin(w * t);
    if (name == "first.angle") return e * c;
    if (name == "first.rate") return e * (-d * c - w * s);
    return e * ((d * d - w * w) * c + 2.0 * d * w * s);
  }

  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Prediction out = TwoLink::Evaluate(theta, stamps);
    for (const QuantityStamps& q : stamps.quantities) {
      Eigen::VectorXd values(static_cast<Eigen::Index>(q.t.size()));
      for (Eigen::Index i = 0; i < values.size(); ++i) {
        values(i) = Quantity(theta, q.quantity, q.t[static_cast<std::size_t>(i)]);
      }
      out.quantities.push_back({q.key, std::move(values)});
    }
    for (int k = 1; k <= 4; ++k) {
      out.events.push_back({(0.5 * k - 0.25) / theta[0], "latch", "elbow"});
    }
    return out;
  }
};

// How an instrument of the arm records.
struct Instrument {
  std::string quantity = "first.acceleration";
  double from = 0.05, to = 3.0, step = 0.01;  // on the model's clock [s]
  double gain = 1.0, bias = 0.0, delay = 0.0, drift = 0.0;
  double sigma = 0.3;
  bool states_sigma = true;
};

// Its readings, by its own clock, in a record whose clock shows `offset` at the release.
inline ChannelRecord Read(const Instrument& i, double offset, Rng& rng) {
  ChannelRecord r;
  r.name = i.quantity;
  r.quantity = i.quantity;
  r.unit = "V";
  std::vector<double> values;
  for (double t = i.from; t <= i.to; t += i.step) {
    r.t.push_back(t + offset);
    values.push_back(i.gain * Instrumented::Quantity(TwoLink::Truth(), i.quantity, t) + i.bias +
                     i.sigma * rng.Normal());
  }
  // What the instrument's clock shows then.
  const double pivot = 0.5 * (r.t.front() + r.t.back());
  for (double& t : r.t) t = pivot + (t + i.delay - pivot) * (1.0 + i.drift);
  r.pivot = pivot;
  const auto n = static_cast<Eigen::Index>(values.size());
  r.y = Eigen::Map<const Eigen::VectorXd>(values.data(), n);
  if (i.states_sigma) r.sigma = Eigen::VectorXd::Constant(n, i.sigma);
  return r;
}

inline FitResult FitInstruments(const Observations& data, bool profile = false) {
  static const Instrumented model;
  return FitTwoLink(model, data, profile);
}

// An accelerometer alone, gain and bias unknown, its clock too: how often intervals hold.
inline Coverage RepeatAccelerometer(int seeds, std::uint64_t first, bool states_sigma) {
  std::vector<FitResult> fits(static_cast<std::size_t>(seeds));
  ParallelFor(fits.size(), 0, [&](std::size_t i) {
    Rng rng(first + i);
    Instrument accelerometer;
    accelerometer.gain = 0.11;
    accelerometer.bias = 0.4;
    accelerometer.sigma = 0.03;
    accelerometer.states_sigma = states_sigma;
    ChannelRecord record = Read(accelerometer, 0.7312, rng);
    record.gain = Prior::Free();
    record.bias = Prior::Free();
    Observations data;
    data.others = {std::make_shared<Channel>(std::move(record))};
    fits[i] = FitInstruments(data);
  });
  return CountCovered(fits);
}

}  // namespace unfurl::correlate
