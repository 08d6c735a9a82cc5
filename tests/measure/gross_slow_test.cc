// Gross readings, many times.
#include "tests/measure/gross.h"

namespace unfurl::measure::gross_slow_test {
namespace {

TEST(GrossSlow, AHundredRecords) {
  const GrossScore score = Gross(1, 100, Swing);
  score.Print();
  EXPECT_GE(score.Share(score.found, 1), 0.95);
  EXPECT_LE(score.Share(score.false_alarm, 0), 0.01);
  EXPECT_LE(score.Ratio(), 1.2);
  EXPECT_GE(score.Share(score.named, 1), 0.98);
  EXPECT_LE(score.Share(score.misnamed, 1), 1e-3);
  EXPECT_LT(score.worst, 5e-3);
}

TEST(GrossSlow, MarksThatVibrate) {
  // 25 Hz with up to 6 mm, and a jump of 0.8 m/s: between two samples a mark moves by more than a
  // bad reading displaces it. More is left open, and of what is claimed the error is 1.4 times the
  // clean one: a narrower forecast than the motion allows would be needed for 1.2.
  const GrossScore score = Gross(1, 30, [](int mark, double t, double phase) {
    Eigen::Vector3d p = Swing(mark, t, phase);
    p.z() += 0.002 * mark * (std::sin(160.0 * t) - std::sin(40.0 * t));
    if (t > 0.7) p.z() += 0.8 * (t - 0.7);
    return p;
  });
  score.Print();
  EXPECT_GE(score.Share(score.found, 1), 0.95);
  EXPECT_LE(score.Share(score.false_alarm, 0), 0.01);
  EXPECT_LE(score.Share(score.misnamed, 1), 1e-3);
  EXPECT_LE(score.Ratio(), 1.5);
  EXPECT_LT(score.worst, 5e-3);
}

}  // namespace
}  // namespace unfurl::measure::gross_slow_test
