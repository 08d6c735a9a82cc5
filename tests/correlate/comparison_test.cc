// A whole comparison of two synthetic records: what it reports against sums over its own signals,
// written out, and against what was put in.
#include "correlate/compare/comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <regex>

#include "base/random_vector.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate::comparison_test {
namespace {

constexpr double kSigma = 5e-5, kRate = 200.0, kDuration = 6.0;

// Three marks that open within a second and then ring at `frequency`, 5 mm and less; 0.05 mm of
// noise.
Observations Opening(double frequency, double later, std::uint64_t seed) {
  constexpr auto kN = static_cast<Eigen::Index>(kDuration * kRate);
  Rng rng(seed);
  Observations o;
  for (int m = 0; m < 3; ++m) {
    MarkSeries s;
    s.name = std::string(1, static_cast<char>('a' + m));
    s.p.resize(3, kN);
    s.cov.resize(6, kN);
    s.shared.resize(3, 0);
    const Eigen::Vector3d from(0.4 + 0.5 * m, 0.1 * m, 0.0);
    const Eigen::Vector3d way(0.2 * m - 0.1, 0.7 - 0.3 * m, 0.0), along(0.4, 1.0, 0.0);
    for (Eigen::Index i = 0; i < kN; ++i) {
      const double at = static_cast<double>(i) / kRate, t = at - later;
      const double open = 0.5 * (1.0 + std::tanh(4.0 * (t - 1.0))),
                   rings = 0.5 * (1.0 + std::tanh(4.0 * (t - 1.8)));
      s.t.push_back(at);
      s.p.col(i) =
          from + open * way +
          rings * 5e-3 / (1.0 + m) * std::sin(2.0 * std::numbers::pi * frequency * t) * along +
          kSigma * NormalVector(&rng);
      s.cov.col(i) << kSigma * kSigma, 0, 0, kSigma * kSigma, 0, kSigma * kSigma;
    }
    o.marks.push_back(std::move(s));
  }
  return o;
}

Comparison Compared(double measured, double reference) {
  Comparison c;
  c.record = "record";
  c.reference = "reference";
  c.marks = {"a", "b", "c"};
  c.observations = Opening(measured, 0.05, 1);
  ComparisonOptions options;
  options.from = 2.5;
  CompareWith(SampledModel(Opening(reference, 0.0, 2)), options, &c);
  return c;
}

TEST(Comparison, SaysHowFarApartPeaksAre) {
  for (const double ratio : {1.02, 0.98}) {
    const Comparison c = Compared(6.0 * ratio, 6.0);
    EXPECT_NEAR(c.alignment.at.offset, 0.05, 0.01);
    double away = -1.0;
    for (const std::string& reason : c.reasons) {
      std::smatch found;
      if (std::regex_search(reason, found, std::regex("at most ([0-9.]+)% away in frequency")))
        away = std::stod(found[1]);
    }
    // Peaks of 3.5 s lie within some hundredths of a hertz.
    EXPECT_NEAR(away, 2.0, 0.5) << ratio;
    ASSERT_FALSE(c.operating_shapes.empty());
    EXPECT_NEAR(c.operating_shapes[0].measured_frequency, 6.0 * ratio, 0.03);
    EXPECT_NEAR(c.operating_shapes[0].reference_frequency, 6.0, 0.03);
    EXPECT_GT(c.operating_shapes[0].mac, 0.98);
  }
}

TEST(Comparison, ScoresOverAllMarksAreSumsOverTheSamples) {
  for (const bool record_is_test : {true, false}) {
    Comparison c;
    c.record_is_test = record_is_test;
    c.marks = {"a", "b", "c"};
    c.observations = Opening(6.12, 0.05, 1);
    ComparisonOptions options;
    options.from = 2.5;
    CompareWith(SampledModel(Opening(6.0, 0.0, 2)), options, &c);
    double samples = 0.0, left = 0.0, total = 0.0, rating = 0.0, largest = 0.0, range2 = 0.0;
    for (const std::string& mark : c.marks) {
      double ratings = 0.0, rated = 0.0, moved2 = 0.0;
      std::vector<double> distance2;
      for (const char* axis : {" x", " y"}) {
        for (const ComparedSignal& s : c.signals) {
          if (s.name != mark + axis) continue;
          const std::vector<double>& test = record_is_test ? s.measured : s.reference;
          const std::vector<double>& computed = record_is_test ? s.reference : s.measured;
          distance2.resize(s.t.size());
          double mean = 0.0;
          for (const double x : test) mean += x / static_cast<double>(test.size());
          std::vector<double> a, b;
          for (std::size_t i = 0; i < s.t.size(); ++i) {
            total += (test[i] - mean) * (test[i] - mean);
            distance2[i] += (test[i] - computed[i]) * (test[i] - computed[i]);
            a.push_back(test[i] - s.reference.front());
            b.push_back(computed[i] - s.reference.front());
          }
          const auto [low, high] = std::minmax_element(test.begin(), test.end());
          moved2 += (*high - *low) * (*high - *low);
          if (*high - *low < 0.02) continue;  // the others move by decimetres
          ratings += RateObjectively(a, b).overall;
          rated += 1.0;
        }
      }
      for (const double d : distance2) {
        left += d;
        largest = std::max(largest, std::sqrt(d));
      }
      samples += static_cast<double>(distance2.size());
      range2 = std::max(range2, moved2);
      rating += ratings / rated / 3.0;
    }
    const ComparedScore& all = c.scores.back();
    constexpr double kRounding = 1e-10;
    EXPECT_EQ(all.name, "all");
    EXPECT_EQ(static_cast<double>(all.score.samples), samples);
    EXPECT_NEAR(all.score.rmse, std::sqrt(left / samples), kRounding);
    EXPECT_NEAR(all.score.r2, 1.0 - left / total, kRounding);
    EXPECT_NEAR(all.score.largest, largest, kRounding);
    EXPECT_NEAR(all.score.range, std::sqrt(range2), kRounding);
    EXPECT_NEAR(all.score.nrmse, std::sqrt(left / samples / range2), kRounding);
    EXPECT_TRUE(all.rated);
    EXPECT_NEAR(all.rating.overall, rating, kRounding);
    EXPECT_EQ(all.rating.grade, GradeOf(all.rating.overall));
  }
}

}  // namespace
}  // namespace unfurl::correlate::comparison_test
