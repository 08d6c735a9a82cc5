// The example of the main job, built against the installed library, gives the program's numbers.
#include <gmock/gmock.h>

#include <bit>
#include <cstdlib>
#include <filesystem>

#include "data/fit.h"
#include "tests/cli/main_job.h"

namespace unfurl::cli::examples_test {
namespace {

namespace fs = std::filesystem;

void ExpectSameBits(double a, double b, const std::string& what) {
  EXPECT_EQ(std::bit_cast<std::uint64_t>(a), std::bit_cast<std::uint64_t>(b))
      << what << ": " << a << " and " << b;
}

using ExamplesTest = MainJobTest;

TEST_F(ExamplesTest, MainJobGivesTheProgramsNumbersToTheBit) {
  JobSettings settings;
  settings.segments = 8;
  settings.duration = 1.2;
  // To the first latch and a little on, without profiles: a shorter job has its bits as well.
  settings.study = StudyOnFourSegments("[profile]\nlevels = []\n");
  settings.clearance = 0.0057;
  settings.damping = 1.9e-4;
  JobResult by_program;
  RunJob(settings, &by_program);
  if (HasFailure()) return;
  const data::FitRecord program = data::ReadFit((folder_ / "fit.h5").string());
  const fs::path other = folder_ / "library";
  fs::create_directory(other);
  const std::string command = "cd '" + other.string() + "' && '" UNFURL_EXAMPLES "/main_job' '" +
                              (folder_ / "survey.h5").string() + "' '" +
                              (folder_ / "trial.h5").string() + "' '" + settings.study + "'";
  ASSERT_EQ(std::system(command.c_str()), 0) << command;
  const data::FitRecord library = data::ReadFit((other / "fit.h5").string());

  ASSERT_EQ(library.parameters.size(), program.parameters.size());
  for (std::size_t j = 0; j < program.parameters.size(); ++j) {
    const auto &a = library.parameters[j], &b = program.parameters[j];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.verdict, b.verdict);
    ExpectSameBits(a.value, b.value, a.name + " value");
    ExpectSameBits(a.sigma, b.sigma, a.name + " sigma");
    ExpectSameBits(a.low95, b.low95, a.name + " low");
    ExpectSameBits(a.high95, b.high95, a.name + " high");
  }
  EXPECT_EQ(library.evaluations.size(), program.evaluations.size());
  EXPECT_TRUE(library.measured == program.measured);
  EXPECT_TRUE(library.simulated == program.simulated);
  EXPECT_TRUE(library.covariance == program.covariance);
}

TEST(Installed, HeadersArePublicOnesOnly) {
  const fs::path include = fs::path(UNFURL_PREFIX) / "include" / "unfurl";
  EXPECT_TRUE(fs::exists(include / "unfurl.h"));
  EXPECT_TRUE(fs::exists(include / "calib" / "calibrate.h"));
  EXPECT_FALSE(fs::exists(include / "cli"));
  EXPECT_FALSE(fs::exists(include / "report"));
  EXPECT_FALSE(fs::exists(include / "data" / "toml_node.h")) << "wraps a library of its own";
  EXPECT_FALSE(fs::exists(include / "data" / "h5_handle.h")) << "wraps a library of its own";
}

}  // namespace
}  // namespace unfurl::cli::examples_test
