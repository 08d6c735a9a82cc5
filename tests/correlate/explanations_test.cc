// Simple causes of a difference: one fault at a time is put into a synthetic record, of any size,
// and has to be named with its value; without a fault, or with a model that is otherwise wrong,
// nothing may be.
#include "correlate/compare/explanations.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>

#include "base/random_vector.h"
#include "correlate/sampled_model.h"

namespace unfurl::correlate::explanations_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;
using Kind = Explanation::Kind;

constexpr double kSigma = 1e-4;  // of the size [-]
constexpr double kRate = 100.0, kDuration = 5.0;

// Four marks of a structure of about `size` that opens and rings at 2 Hz; the noise in proportion.
Observations Opening(double size, std::uint64_t seed, double frequency = 2.0, double clock = 0.0) {
  Rng rng(seed);
  Observations o;
  constexpr auto kN = static_cast<Eigen::Index>(kDuration * kRate);
  for (int m = 0; m < 4; ++m) {
    MarkSeries s;
    s.name = std::string(1, static_cast<char>('a' + m));
    s.p.resize(3, kN);
    s.cov.resize(6, kN);
    s.shared.resize(3, 0);
    const double v = kSigma * size * kSigma * size;
    for (Eigen::Index i = 0; i < kN; ++i) {
      const double t = static_cast<double>(i) / kRate;
      const double open = 0.5 * (1.0 + std::tanh(3.0 * (t - 1.0)));
      const double bend = 0.02 * open * std::sin(2.0 * std::numbers::pi * frequency * t);
      const double angle = 0.3 * m + (1.0 + 0.2 * m) * open + (1.0 + m) * bend;
      s.t.push_back(t * (1.0 + clock));
      s.p.col(i) = size * (Eigen::Vector3d((0.4 + 0.25 * m) * std::cos(angle),
                                           (0.4 + 0.25 * m) * std::sin(angle), 0.0) +
                           kSigma * NormalVector(&rng));
      s.cov.col(i) << v, 0, 0, v, 0, v;
    }
    o.marks.push_back(std::move(s));
  }
  return o;
}

std::vector<Explanation> Explained(const Observations& record, double size, bool lengths = true) {
  const SampledModel reference(Opening(size, 99));
  ExplanationOptions options;
  options.lengths = lengths;
  return ExplainDifference(record, reference, Align(record, reference), options);
}

// 0.1 m, a few metres, 30 m.
class Explanations : public ::testing::TestWithParam<double> {};

TEST_P(Explanations, AClockAtAnotherRate) {
  for (const double fast : {1e-3, -4e-3}) {
    const auto found = Explained(Opening(GetParam(), 1, 2.0, fast), GetParam());
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].kind, Kind::kClock);
    EXPECT_NEAR(found[0].value, fast, 0.05 * std::fabs(fast));
    EXPECT_LT(found[0].left, 3.0 * kSigma * GetParam());
  }
}

TEST_P(Explanations, LengthsThatAreAllLonger) {
  for (const double ratio : {1.002, 0.97}) {
    Observations record = Opening(GetParam(), 2);
    for (MarkSeries& mark : record.marks) mark.p *= ratio;
    const auto found = Explained(record, GetParam());
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].kind, Kind::kLengths);
    EXPECT_NEAR(found[0].value, ratio, 2e-5);
    EXPECT_THAT(Explained(record, GetParam(), false), IsEmpty());  // of two runs nobody asks
  }
}

TEST_P(Explanations, NamesThatAreExchanged) {
  for (const auto& [i, j] : std::vector<std::pair<std::size_t, std::size_t>>{{0, 1}, {1, 3}}) {
    Observations record = Opening(GetParam(), 3);
    std::swap(record.marks[i].name, record.marks[j].name);
    const auto found = Explained(record, GetParam());
    ASSERT_EQ(found.size(), 1u);
    EXPECT_EQ(found[0].kind, Kind::kNames);
    EXPECT_THAT(found[0].marks, UnorderedElementsAre(record.marks[i].name, record.marks[j].name));
  }
}

// Glued on elsewhere on its body: the offset turns with it.
TEST_P(Explanations, AMarkThatSitsElsewhere) {
  Observations record = Opening(GetParam(), 4);
  MarkSeries& mark = record.marks[2];
  for (Eigen::Index i = 0; i < mark.p.cols(); ++i) {
    const Eigen::Vector3d p = mark.p.col(i);
    mark.p.col(i) = 1.05 * p + 0.03 * Eigen::Vector3d(-p.y(), p.x(), 0.0);
  }
  const auto found = Explained(record, GetParam());
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, Kind::kMark);
  EXPECT_THAT(found[0].marks, ElementsAre("c"));
}

TEST_P(Explanations, NothingOfNoDifferenceAndOfAWrongModel) {
  for (std::uint64_t seed = 10; seed < 16; ++seed) {
    EXPECT_THAT(Explained(Opening(GetParam(), seed), GetParam()), IsEmpty()) << seed;
    EXPECT_THAT(Explained(Opening(GetParam(), seed, 2.3), GetParam()), IsEmpty()) << seed;
  }
}
INSTANTIATE_TEST_SUITE_P(Sizes, Explanations, ::testing::Values(0.1, 3.0, 30.0));

// A record of many samples is thinned for it: the answer stays.
TEST(ExplanationsOfLongRecords, AreTheSame) {
  Observations record = Opening(1.0, 5, 2.0, 2e-3);
  Observations longer;
  for (const MarkSeries& mark : record.marks) {
    MarkSeries many;
    many.name = mark.name;
    const Eigen::Index n = mark.p.cols(), times = 12;
    many.p.resize(3, n * times);
    many.cov.resize(6, n * times);
    many.shared.resize(3, 0);
    Rng rng(6);
    for (Eigen::Index i = 0; i < n * times; ++i) {
      // Between two samples on a straight line, with noise of its own.
      const double at = static_cast<double>(i) / static_cast<double>(times);
      const auto k = std::min(static_cast<Eigen::Index>(at), n - 2);
      const double part = at - static_cast<double>(k);
      many.t.push_back(mark.t[static_cast<std::size_t>(k)] * (1.0 - part) +
                       mark.t[static_cast<std::size_t>(k) + 1] * part);
      many.p.col(i) =
          mark.p.col(k) * (1.0 - part) + mark.p.col(k + 1) * part + kSigma * NormalVector(&rng);
      many.cov.col(i) = mark.cov.col(k);
    }
    longer.marks.push_back(std::move(many));
  }
  ASSERT_GT(longer.size(), 20000u);
  const auto found = Explained(longer, 1.0);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].kind, Kind::kClock);
  EXPECT_NEAR(found[0].value, 2e-3, 1e-4);
}

}  // namespace
}  // namespace unfurl::correlate::explanations_test
