// Plans of campaigns.
#include "data/campaign.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "base/error.h"

namespace unfurl::data::campaign_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr char kHead[] = "[campaign]\n";
constexpr char kScene[] = "[job]\nscene = \"s.toml\"\n";
constexpr char kVariable[] = "[variable.v]\nkeys = [\"a.b\"]\nuniform = [0, 1]\n";
constexpr char kResponse[] = "[response.r]\nquantity = \"hub.x\"\n";

std::string Whole(const std::string& head = kHead, const std::string& job = kScene,
                  const std::string& variable = kVariable,
                  const std::string& response = kResponse) {
  return head + job + variable + response;
}

std::string Refused(const std::string& text) {
  try {
    ParseCampaign(text, "plan.toml");
  } catch (const Error& e) {
    return e.what();
  }
  return "taken";
}

TEST(Campaign, APlanIsReadWithItsDefaults) {
  const Campaign plan = ParseCampaign(Whole(), "folder/plan.toml");
  EXPECT_EQ(plan.name, "plan");
  EXPECT_EQ(plan.job.scene, "folder/s.toml");
  EXPECT_EQ(plan.design.kind, CampaignDesign::Kind::kLatin);
  EXPECT_EQ(plan.design.runs, 1000U);
  EXPECT_EQ(plan.design.blocks, 16);
  ASSERT_EQ(plan.variables.size(), 1U);
  EXPECT_THAT(plan.variables[0].keys, ElementsAre("a.b"));
  ASSERT_EQ(plan.responses.size(), 1U);
  EXPECT_EQ(plan.responses[0].of, "peak");
  EXPECT_FALSE(plan.responses[0].yes_no);
}

TEST(Campaign, ThresholdsMakeYesOrNo) {
  const Campaign plan = ParseCampaign(
      Whole(kHead, kScene, kVariable,
            std::string(kResponse) + "above = 3\n[response.s]\nexpression = \"r - v\"\n"
                                     "below = 2\nabove = 1\n[response.t]\n"
                                     "event = \"latch\"\n"),
      "plan.toml");
  EXPECT_TRUE(plan.responses[0].yes_no);
  EXPECT_EQ(*plan.responses[0].above, 3.0);
  EXPECT_TRUE(plan.responses[1].yes_no);
  EXPECT_TRUE(plan.responses[2].yes_no);  // it happened, or it did not
}

TEST(Campaign, ARecordGivesBackThePlan) {
  const std::string text = Whole(
      "[campaign]\nname = \"n\"\ndesign = \"saltelli\"\nruns = 12\nseed = 7\nconfidence = 0.9\n",
      kScene,
      "[variable.v]\nkeys = [\"a.b\", \"c\"]\nunit = \"m\"\nnormal = [1, 2]\ntruncate = [0, 3]\n"
      "[variable.w]\nkeys = [\"d\"]\nvalues = [1, 2]\nweights = [1, 3]\n",
      "[response.r]\nquantity = \"hub.x\"\nof = \"at\"\nat = 0.5\nbelow = 2\n");
  const Campaign plan = ParseCampaign(text, "plan.toml");
  const std::string json = CampaignJson(plan);
  const Campaign again = CampaignFromJson(json, "here");
  EXPECT_EQ(CampaignJson(again), json);
  EXPECT_EQ(again.variables[0].distribution.high, 3.0);
  EXPECT_FALSE(again.responses[0].above.has_value());
  EXPECT_EQ(*again.responses[0].below, 2.0);
  EXPECT_THROW(CampaignFromJson("{\"name\": 1}", "here"), Error);
  EXPECT_THROW(CampaignFromJson("no json", "here"), Error);
  // A number that no cast to an integer holds, or that it would change.
  const std::string key = "\"blocks\":16";
  ASSERT_NE(json.find(key), std::string::npos);
  for (const char* number : {"1e40", "16.5", "-9999999999", "99999999999999999999"}) {
    std::string damaged = json;
    damaged.replace(damaged.find(key), key.size(), std::string("\"blocks\":") + number);
    EXPECT_THROW(CampaignFromJson(damaged, "here"), Error) << number;
  }
}

struct Wrong {
  std::string text;
  std::vector<std::string> words;  // of the message
};
void PrintTo(const Wrong& wrong, std::ostream* out) { *out << wrong.text; }

class CampaignRefused : public ::testing::TestWithParam<Wrong> {};

TEST_P(CampaignRefused, WithPlaceAndRemedy) {
  const std::string message = Refused(GetParam().text);
  for (const std::string& word : GetParam().words) EXPECT_THAT(message, HasSubstr(word));
  EXPECT_THAT(message, HasSubstr("plan.toml"));
}

std::string Variable(const std::string& keys) {
  return Whole(kHead, kScene, "[variable.v]\nkeys = [\"a.b\"]\n" + keys);
}
std::string Response(const std::string& text) {
  return Whole(kHead, kScene, kVariable, "[response.r]\n" + text);
}

INSTANTIATE_TEST_SUITE_P(
    Plans, CampaignRefused,
    ::testing::Values(
        Wrong{Variable("normal = [1, 0]\n"), {"variable.v.normal", "sigma"}},
        Wrong{Variable("normal = [1, 1]\nuniform = [0, 1]\n"), {"stands beside"}},
        Wrong{Variable(""), {"no distribution", "normal = [mean, sigma]"}},
        Wrong{Variable("uniform = [1, 1]\n"), {"low is not below high"}},
        Wrong{Variable("log_normal = [1, 1]\n"), {"factor"}},
        Wrong{Variable("log_uniform = [0, 1]\n"), {"0 < low"}},
        Wrong{Variable("triangular = [0, 2, 1]\n"), {"mode"}},
        Wrong{Variable("values = []\n"), {"no values"}},
        Wrong{Variable("values = [1, 2]\nweights = [1]\n"), {"weights"}},
        Wrong{Variable("uniform = [0, 1]\ntruncate = [2, 1]\n"), {"truncate"}},
        Wrong{Variable("uniform = [0, nan]\n"), {"uniform"}},
        Wrong{Variable("unifrom = [0, 1]\n"), {"variable.v"}},
        Wrong{Whole(kHead, kScene, ""), {"[variable.NAME]"}},
        Wrong{Whole(kHead, kScene, kVariable, ""), {"[response.NAME]"}},
        Wrong{Whole(kHead, "[job]\n"), {"job.scene"}},
        Wrong{Whole("[campaign]\ndesign = \"latim\"\n"), {"latin"}},
        Wrong{Whole("[campaign]\nruns = 0\n"), {"campaign.runs"}},
        Wrong{Whole("[campaign]\nuntil = \"P(r) +- 0.1\"\n"), {"campaign.until", "random"}},
        Wrong{Whole("[campaign]\ndesign = \"grid\"\n"), {"levels"}},
        Wrong{Whole("[campaign]\ndesign = \"rare\"\nfailure = \"q\"\n"), {"no response 'q'"}},
        Wrong{Response(""), {"where it comes from"}},
        Wrong{Response("quantity = \"a\"\nevent = \"latch\"\n"), {"stands beside"}},
        Wrong{Response("quantity = \"a\"\nof = \"at\"\n"), {"response.r", "at"}},
        Wrong{Response("quantity = \"a\"\nfrom = 2\nto = 1\n"), {"from"}},
        Wrong{Response("event = \"latch\"\nabove = 1\n"), {"yes or no"}},
        Wrong{Response("quantity = \"a\"\nabove = 2\nbelow = 1\n"), {"between"}},
        Wrong{Response("pointer = \"/a\"\n"), {"response.r"}},
        Wrong{Whole(kHead, kScene, kVariable, "[response.v]\nquantity = \"a\"\n"),
              {"variable's name"}},
        Wrong{Whole(kHead, kScene, kVariable, "[response.\"a b\"]\nquantity = \"a\"\n"),
              {"letters, digits"}},
        Wrong{Whole(kHead, "[job]\n[[job.step]]\nrun = [\"unfurl\", \"{v}\"]\n",
                    "[variable.v]\nuniform = [0, 1]\n", "[response.r]\npointer = \"a\"\n"),
              {"begin with '/'"}},
        Wrong{
            Whole(kHead, "[job]\n[[job.step]]\nrun = [\"unfurl\", \"{v}\"]\n",
                  "[variable.v]\nuniform = [0, 1]\n", "[response.r]\npointer = \"/a\"\nstep = 2\n"),
            {"there are 1 steps"}},
        Wrong{Whole() + "[[correlation]]\nbetween = [\"v\", \"w\"]\nvalue = 0.5\n",
              {"no variable 'w'"}}));

TEST(Campaign, RowsAndSamplesComeFromFilesBesideThePlan) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("unfurl-campaign-test-" + std::to_string(getpid()));
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "rows.csv") << "v,other\n1,5\n2,6\n3.5,7\n";
  std::ofstream(folder / "plan.toml")
      << Whole("[campaign]\ndesign = \"file\"\nfile = \"rows.csv\"\n", kScene,
               "[variable.v]\nkeys = [\"a\"]\n");
  const Campaign plan = ReadCampaign((folder / "plan.toml").string());
  EXPECT_EQ(plan.design.runs, 3U);
  EXPECT_EQ(plan.design.rows[2][0], 3.5);
  EXPECT_THAT(plan.inputs, ElementsAre((folder / "rows.csv").string()));
  std::ofstream(folder / "plan.toml")
      << Whole(kHead, kScene, "[variable.v]\nkeys = [\"a\"]\nsamples = \"rows.csv\"\n");
  EXPECT_THAT(ReadCampaign((folder / "plan.toml").string()).variables[0].distribution.values,
              ElementsAre(1.0, 2.0, 3.5));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace unfurl::data::campaign_test
