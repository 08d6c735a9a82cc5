// Nothing in this room has a preferred length or time: the same records in other sizes and paces
// are aligned, compared, transformed and fitted alike, and every number comes back once scaled
// back.
#include <gtest/gtest.h>

#include <cmath>
#include <span>

#include "correlate/compare/comparison.h"
#include "correlate/fit/fit.h"
#include "correlate/residual/timed_events.h"
#include "tests/correlate/fit_repeats.h"
#include "tests/correlate/two_link.h"
#include "tests/repeats.h"

namespace unfurl::correlate::scaling_test {
namespace {

struct Scale {
  double length = 1.0, time = 1.0;
  // Of a unit m^i s^j.
  double Of(int i, int j) const { return std::pow(length, i) * std::pow(time, j); }
};

// A wing of kilometres that opens for a day, a hinge of micrometres, and lengths and times alone.
std::span<const Scale> Scales() {
  static constexpr Scale kAll[] = {{3e3, 8.64e4}, {1e-6, 1e-5}, {10, 1}, {1, 0.1},
                                   {0.1, 1},      {30, 1},      {1, 10}};
  return std::span(kAll).first(static_cast<std::size_t>(Repeats(2, 7)));
}

// Rounding goes another way at every product.
constexpr double kSame = 1e-9;
// Iterations end where a step would move an unknown by a small part of its standard error, and
// which of two steps is the last turns on the rounding: values by this part of their standard
// errors (fits of modes end at a thousandth of one, with quadratic convergence; the fit is asked
// for 1e-6).
constexpr double kSigmas = 1e-5;

class ScaledModel : public Model {
 public:
  ScaledModel(const Model& model, Scale scale) : model_(model), scale_(scale) {}
  Prediction Evaluate(std::span<const double> theta, const Stamps& stamps) const override {
    Stamps own = stamps;
    for (auto& list : own.t) {
      for (double& t : list) t /= scale_.time;
    }
    // A frequency and a decay, both per second.
    const double own_theta[] = {theta[0] * scale_.time, theta[1] * scale_.time};
    Prediction out = model_.Evaluate(own_theta, own);
    for (MarkMotion& mark : out.marks) {
      mark.p *= scale_.length;
      mark.v *= scale_.length / scale_.time;
      mark.cov *= scale_.length * scale_.length;
    }
    out.noise *= scale_.length;
    for (ModelEvent& e : out.events) e.t *= scale_.time;
    return out;
  }

 private:
  const Model& model_;
  Scale scale_;
};

Observations Scaled(Observations record, Scale scale) {
  for (MarkSeries& series : record.marks) {
    for (double& t : series.t) t *= scale.time;
    series.p *= scale.length;
    series.cov *= scale.length * scale.length;
    series.shared *= scale.length;
  }
  for (auto& kind : record.others) {
    std::vector<TimedEvent> events = dynamic_cast<const TimedEvents&>(*kind).events();
    for (TimedEvent& e : events) {
      e.t *= scale.time;
      e.sigma *= scale.time;
    }
    kind = std::make_shared<TimedEvents>(std::move(events));
  }
  return record;
}

// `got` in other units is `expected`, to kSame of the larger of it and `size`.
void Same(double got, double expected, double factor, double size, const char* what) {
  if (std::isnan(expected)) {
    EXPECT_TRUE(std::isnan(got)) << what;
    return;
  }
  EXPECT_NEAR(got / factor, expected, kSame * std::max(std::abs(expected), size)) << what;
}

// The same to a part of a standard error `sigma` of `expected`.
void SameWithin(double got, double expected, double factor, double sigma, const char* what) {
  EXPECT_NEAR(got / factor, expected, kSame * std::abs(expected) + kSigmas * sigma) << what;
}

void SameRegistration(const Registration& one, const Registration& other, Scale scale) {
  EXPECT_LT((one.X_WM.linear() - other.X_WM.linear()).cwiseAbs().maxCoeff(), kSame);
  for (int k = 0; k < 3; ++k) {
    Same(other.X_WM.translation()(k), one.X_WM.translation()(k), scale.length,
         one.X_WM.translation().norm(), "translation");
  }
  Same(other.offset, one.offset, scale.time, 1.0, "offset");
  Same(other.drift, one.drift, 1.0, 1.0, "drift");
}

Comparison Compared(Scale scale) {
  Trial trial = TiltedTrial();
  trial.duration = 6.0;
  Rng rng(3);
  const TwoLink model;
  Comparison c;
  c.record = "record", c.reference = "reference";
  c.marks = TwoLink::Marks();
  // A reference of another frequency, so that there is something to compare.
  c.observations = Scaled(Record(model, TwoLink::Truth(), c.marks, trial, rng), scale);
  const ScaledModel scaled(model, scale);
  const double theta[] = {0.91 / scale.time, 0.33 / scale.time};
  ComparisonOptions options;
  options.from = 1.5 * scale.time;
  options.clock_drift = true;
  CompareWith(SampledModel(scaled, theta, c.marks, 0.0, 6.0 * scale.time, 0.01 * scale.time),
              options, &c);
  return c;
}

TEST(Scaling, OfLengthsAndTimesChangesNoComparison) {
  const Comparison one = Compared({});
  ASSERT_TRUE(one.alignment.Usable()) << one.alignment.message;
  ASSERT_FALSE(one.spectra.empty());
  ASSERT_FALSE(one.measured_modes.decay.modes.empty());
  for (const Scale scale : Scales()) {
    SCOPED_TRACE(testing::Message() << "lengths " << scale.length << ", times " << scale.time);
    const Comparison other = Compared(scale);
    ASSERT_EQ(other.alignment.status, one.alignment.status) << other.alignment.message;
    const auto after_length = [](const std::string& text) {
      return text.substr(text.find(" RMS"));
    };
    EXPECT_EQ(after_length(other.verdict), after_length(one.verdict));
    EXPECT_EQ(other.reasons.size(), one.reasons.size());
    SameRegistration(one.alignment.at, other.alignment.at, scale);
    Same(other.alignment.r2, one.alignment.r2, 1.0, 1.0, "r2");
    Same(other.alignment.chi2_per_dof, one.alignment.chi2_per_dof, 1.0, 1.0, "chi2");
    Same(other.alignment.misfit, one.alignment.misfit, scale.length, 0.0, "misfit");
    Same(other.alignment.Sigma("offset"), one.alignment.Sigma("offset"), scale.time, 0.0,
         "sigma of the offset");
    ASSERT_EQ(other.errors.size(), one.errors.size());
    for (std::size_t m = 0; m < one.errors.size(); ++m) {
      Same(other.errors[m].rmse, one.errors[m].rmse, scale.length, 0.0, "rmse");
      Same(other.errors[m].largest_at, one.errors[m].largest_at, scale.time, 0.0, "largest at");
      Same(other.errors[m].sigmas, one.errors[m].sigmas, 1.0, 0.0, "sigmas");
    }
    ASSERT_EQ(other.scores.size(), one.scores.size());
    for (std::size_t i = 0; i < one.scores.size(); ++i) {
      const ComparedScore &a = one.scores[i], &b = other.scores[i];
      EXPECT_EQ(b.name, a.name);
      EXPECT_EQ(b.rated, a.rated);
      Same(b.score.rmse, a.score.rmse, a.of == ComparedScore::Of::kAngle ? 1.0 : scale.length, 0.0,
           "rmse");
      Same(b.score.sprague_geers, a.score.sprague_geers, 1.0, 0.0, "Sprague and Geers");
      Same(b.score.russell, a.score.russell, 1.0, 0.0, "Russell");
      Same(b.rating.overall, a.rating.overall, 1.0, 1.0, "rating");
    }
    ASSERT_EQ(other.spectra.size(), one.spectra.size());
    for (std::size_t i = 0; i < one.spectra.size(); ++i) {
      const ComparedSpectrum &a = one.spectra[i], &b = other.spectra[i];
      const double unit = a.id.IsAngle() ? 1.0 : scale.length;
      ASSERT_EQ(b.measured_peaks.size(), a.measured_peaks.size()) << a.name;
      for (std::size_t k = 0; k < a.measured_peaks.size(); ++k) {
        Same(b.measured_peaks[k].frequency, a.measured_peaks[k].frequency, 1.0 / scale.time, 0.0,
             "peak's frequency");
        Same(b.measured_peaks[k].amplitude, a.measured_peaks[k].amplitude, unit, 0.0,
             "peak's amplitude");
      }
      EXPECT_EQ(b.pairs.size(), a.pairs.size());
      Same(b.frac, a.frac, 1.0, 1.0, "FRAC");
    }
    for (const auto& [a, b] : {std::pair(&one.measured_modes, &other.measured_modes),
                               std::pair(&one.reference_modes, &other.reference_modes)}) {
      EXPECT_EQ(b->decay.status, a->decay.status);
      // A reference without noise is a sum of decays to rounding only, and which of the weakest
      // stay from order to order is rounding's.
      if (a == &one.reference_modes) continue;
      ASSERT_EQ(b->decay.modes.size(), a->decay.modes.size());
      for (std::size_t k = 0; k < a->decay.modes.size(); ++k) {
        const Mode &m = a->decay.modes[k], &n = b->decay.modes[k];
        const double unit = 1.0 / scale.time;
        SameWithin(n.frequency, m.frequency, unit, m.frequency_sigma, "mode's frequency");
        SameWithin(n.frequency_sigma, m.frequency_sigma, unit, m.frequency_sigma, "its error");
        SameWithin(n.damping, m.damping, 1.0, m.damping_sigma, "mode's damping");
      }
    }
  }
}

FitResult Fitted(Scale scale) {
  const TwoLink model;
  const ScaledModel scaled(model, scale);
  Trial trial = SparseTrial();
  trial.shared_rank = 2, trial.shared_size = 1e-4;
  trial.rho = 0.4;  // residuals that want whitening
  Rng rng(11);
  const Observations data =
      Scaled(Record(model, TwoLink::Truth(), {"base", "elbow", "tip"}, trial, rng), scale);
  FitProblem problem;
  problem.parameters = TwoLinkParameters();
  for (Parameter& p : problem.parameters) {
    p.start /= scale.time, p.low /= scale.time, p.high /= scale.time;
  }
  problem.trials.resize(1);
  problem.trials[0].model = &scaled;
  problem.trials[0].observations = &data;
  FitOptions options;
  options.workers = 1;
  options.stages = {1.0 * scale.time, 2.0 * scale.time};
  options.profile.wanted = true;
  options.step_tolerance = 1e-6;
  return Fit(problem, options);
}

TEST(Scaling, OfLengthsAndTimesChangesNoFit) {
  const FitResult one = Fitted({});
  ASSERT_TRUE(one.Usable()) << one.message;
  for (const Scale scale : Scales()) {
    SCOPED_TRACE(testing::Message() << "lengths " << scale.length << ", times " << scale.time);
    const FitResult other = Fitted(scale);
    ASSERT_EQ(other.status, one.status) << other.message;
    EXPECT_EQ(other.evaluations.size(), one.evaluations.size());
    SameRegistration(one.trials[0].at, other.trials[0].at, scale);
    EXPECT_EQ(other.trials[0].goodness.outcome, one.trials[0].goodness.outcome);
    Same(other.trials[0].chi2_per_dof, one.trials[0].chi2_per_dof, 1.0, 1.0, "chi2");
    for (std::size_t j = 0; j < one.parameters.size(); ++j) {
      const ParameterEstimate &a = one.parameters[j], &b = other.parameters[j];
      EXPECT_EQ(b.verdict, a.verdict) << b.reason;
      const double unit = 1.0 / scale.time;
      SameWithin(b.value, a.value, unit, a.sigma, "value");
      SameWithin(b.sigma, a.sigma, unit, a.sigma, "standard error");
      SameWithin(b.all95.low, a.all95.low, unit, a.sigma, "interval's low end");
      SameWithin(b.all95.high, a.all95.high, unit, a.sigma, "interval's high end");
      EXPECT_EQ(b.profile.points.size(), a.profile.points.size());
    }
  }
}

}  // namespace
}  // namespace unfurl::correlate::scaling_test
