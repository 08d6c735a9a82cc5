// `correlate` through the program, on tracks in closed form: what it says against what was planted.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/random.h"
#include "tests/cli/program.h"

namespace unfurl::cli::correlate_test {
namespace {

using ::testing::HasSubstr;

constexpr double kTau = 2.0 * std::numbers::pi;
constexpr double kSigmas = 4.5;  // of any one number: once in 150,000

struct Ring {
  double frequency, damping;
};
constexpr Ring kFirst{2.1, 0.012}, kSecond{5.3, 0.008};

// Struck at 1 s, as by a latch: speeds jump, positions do not.
double Decay(const Ring& r, double t) {
  const double w0 = kTau * r.frequency;
  return t < 1.0 ? 0.0
                 : std::exp(-r.damping * w0 * (t - 1.0)) *
                       std::sin(w0 * std::sqrt(1.0 - r.damping * r.damping) * (t - 1.0));
}

// Opens within a second, then rings: marks `left` and `right` on one body that turns a little, and
// `tip`, and `post` that stands still, strobed one after another.
std::string Tracks(double sigma, double offset, double drift, double first_factor, Rng rng) {
  std::string csv =
      "t [s],mark,x [m],y [m],z [m],cxx [m^2],cxy [m^2],cxz [m^2],cyy [m^2],cyz [m^2],czz "
      "[m^2],status\n";
  for (int i = 0; i < 1000; ++i) {
    for (int m = 0; m < 4; ++m) {
      const double t = 0.005 * i + 0.001 * m;
      const double open = t < 1.0 ? 0.5 - 0.5 * std::cos(std::numbers::pi * t) : 1.0;
      const double a = first_factor * Decay(kFirst, t), b = Decay(kSecond, t);
      const double turn = 0.3 * open + 0.01 * a - 0.004 * b;
      double x = 1.0 + 0.5 * open + 0.004 * a, y = 0.8 * open + 0.03 * a + 0.01 * b;
      if (m < 2) {
        x = (m == 0 ? -0.2 : 0.2) * std::cos(turn);
        y = (m == 0 ? -0.2 : 0.2) * std::sin(turn);
      }
      if (m == 3) x = 0.5, y = -0.5;
      const double noise = m == 3 ? 0.0 : sigma;
      const char* const names[] = {"left", "right", "tip", "post"};
      const double middle = 2.5, shown = middle + (t - middle) * (1.0 + drift) + offset;
      csv += fmt::format("{:.9f},{},{:.9f},{:.9f},{:.9f},{:.3e},0,0,{:.3e},0,{:.3e},good\n", shown,
                         names[m], x + noise * rng.Normal(), y + noise * rng.Normal(),
                         noise * rng.Normal(), sigma * sigma, sigma * sigma, sigma * sigma);
    }
  }
  return csv;
}

class CorrelateTest : public ProgramTest {};

TEST_F(CorrelateTest, TellsWhatWasPlanted) {
  Put("a.csv", Tracks(1e-4, 0.75, 0.0, 1.0, Rng(1)));
  Put("b.csv", Tracks(1e-5, 0.0, 0.0, 1.0, Rng(2)));
  const Outcome o = Run({"correlate", "a.csv", "b.csv", "--from", "1.8", "--to", "5.7", "--json",
                         "--report", "page.html", "--figures", "figures"});
  ASSERT_EQ(o.code, 0) << o.out << o.err;
  const auto json = nlohmann::json::parse(o.out);
  const auto& offset = json.at("time_offset");
  EXPECT_LT(std::abs(offset.at("value").get<double>() - 0.75),
            kSigmas * offset.at("sigma").get<double>());
  EXPECT_LT(json.at("errors").back().at("sigmas").get<double>(), 1.1);
  const auto& all = json.at("scores").back();
  EXPECT_EQ(all.at("name"), "all");
  EXPECT_EQ(all.at("iso_18571").at("grade"), "excellent");
  EXPECT_GT(all.at("r2").get<double>(), 0.9999);
  for (const auto& score : json.at("scores")) {
    if (score.at("name") != "post") continue;
    // What stands still has no motion to be measured by. Its errors are those of the frame.
    EXPECT_TRUE(score.at("r2").is_null() && score.at("iso_18571").is_null()) << score;
    EXPECT_LT(score.at("largest").get<double>(), 1e-4);
  }
  EXPECT_LT(all.at("sprague_geers").at("combined").get<double>(), 0.01);
  // The body's angle has frames' signs, but the same frequencies.
  const auto& modes = json.at("modes").at("measured").at("modes");
  ASSERT_EQ(modes.size(), 2u) << modes;
  for (const auto& [k, ring] : {std::pair{0, kFirst}, std::pair{1, kSecond}}) {
    const auto& m = modes[static_cast<std::size_t>(k)];
    EXPECT_LT(std::abs(m.at("frequency").get<double>() - ring.frequency),
              kSigmas * m.at("frequency_sigma").get<double>());
    EXPECT_LT(std::abs(m.at("damping_ratio").get<double>() - ring.damping),
              kSigmas * m.at("damping_ratio_sigma").get<double>());
  }
  EXPECT_GT(json.at("modes").at("pairs").at(0).at("mac").get<double>(), 0.99);
  for (const auto& s : json.at("spectra")) {
    EXPECT_THAT(s.at("convention").get<std::string>(), HasSubstr("single-sided amplitude"));
    EXPECT_THAT(s.at("density").at("convention").get<std::string>(), HasSubstr("^2/Hz"));
  }
  const std::string page = Get("page.html");
  for (const char* words : {"Stabilisation diagram", "ISO/TS 18571", "Coherence", "MAC"}) {
    EXPECT_THAT(page, HasSubstr(words));
  }
  for (const char* file : {"figure-15.svg", "figure-16a.svg", "figure-16b.svg", "figure-17.svg"}) {
    EXPECT_THAT(Get(std::string("figures/") + file), HasSubstr("</svg>")) << file;
  }
  const Outcome again = Run({"correlate", "a.csv", "b.csv", "--figures", "figures", "--quiet"});
  EXPECT_EQ(again.code, 0) << "its own earlier figures may be replaced: " << again.err;
}

TEST_F(CorrelateTest, SeesAMotionTooLargeAsTooLarge) {
  Put("a.csv", Tracks(1e-4, 0.0, 0.0, 1.5, Rng(3)));
  Put("b.csv", Tracks(1e-4, 0.0, 0.0, 1.0, Rng(4)));
  const Outcome o = Run({"correlate", "a.csv", "b.csv", "--from", "1.1", "--json"});
  ASSERT_EQ(o.code, 0) << o.out << o.err;
  const auto json = nlohmann::json::parse(o.out);
  EXPECT_EQ(json.at("test"), "reference");
  const auto &a = json.at("modes").at("measured").at("modes"),
             &b = json.at("modes").at("reference").at("modes");
  ASSERT_EQ(a.size(), 2u);
  ASSERT_EQ(b.size(), 2u);
  auto amplitude = [](const nlohmann::json& m) { return m.at("amplitude").get<double>(); };
  // The frame cannot imitate the larger swing, but turns by a little of it.
  EXPECT_NEAR(amplitude(a[0]) / amplitude(b[0]), 1.5, 0.05);
  EXPECT_NEAR(amplitude(a[1]) / amplitude(b[1]), 1.0, 0.05);
}

TEST_F(CorrelateTest, FindsAClockThatRunsFast) {
  Put("a.csv", Tracks(1e-4, 0.0, 4e-4, 1.0, Rng(5)));
  Put("b.csv", Tracks(1e-5, 0.0, 0.0, 1.0, Rng(6)));
  const Outcome o = Run({"correlate", "a.csv", "b.csv", "--clock-drift", "--json"});
  ASSERT_EQ(o.code, 0) << o.out << o.err;
  const auto drift = nlohmann::json::parse(o.out).at("clock_drift");
  EXPECT_LT(std::abs(drift.at("value").get<double>() - 4e-4),
            kSigmas * drift.at("sigma").get<double>());
  EXPECT_LT(drift.at("sigma").get<double>(), 1e-4);
}

TEST_F(CorrelateTest, AnEmptyStretchIsRefused) {
  Put("a.csv", Tracks(1e-4, 0.0, 0.0, 1.0, Rng(1)));
  ExpectRefused(Run({"correlate", "a.csv", "a.csv", "--from", "3", "--to", "2"}), {"--from"},
                {"a.csv"});
}

TEST_F(CorrelateTest, AnUnknownWindowIsRefused) {
  Put("a.csv", Tracks(1e-4, 0.0, 0.0, 1.0, Rng(1)));
  ExpectRefused(Run({"correlate", "a.csv", "a.csv", "--window", "hanning"}), {"hanning", "hann"},
                {"a.csv"});
}

}  // namespace
}  // namespace unfurl::cli::correlate_test
