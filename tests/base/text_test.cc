#include "base/text.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/sentence.h"

namespace unfurl::text_test {
namespace {

TEST(Text, NearestNameIsWhatWasMeantOrNothing) {
  const std::vector<std::string> known = {"mass", "length", "segments", "EI"};
  EXPECT_EQ(NearestName("masss", known), "mass");
  EXPECT_EQ(NearestName("segmets", known), "segments");
  EXPECT_EQ(NearestName("colour_temperature", known), "");
}

TEST(Text, WordsAreJoinedAsSpoken) {
  EXPECT_EQ(JoinWords(std::vector<std::string>{"a"}), "a");
  EXPECT_EQ(JoinWords(std::vector<std::string>{"a", "b", "c"}), "a, b and c");
}

TEST(Text, SentencesBeginWithACapitalAndSymbolsStayWhatTheyAre) {
  EXPECT_EQ(Capitalised("damping and k are known"), "Damping and k are known");
  EXPECT_EQ(Capitalised("no latch closed"), "No latch closed");
  for (const char* as_is :
       {"", "k and damping are known", "m_2 is open", "K is", "12 are", "x: y"}) {
    EXPECT_EQ(Capitalised(as_is), as_is);
  }
}

TEST(Text, NumbersAreTakenWholeOrNotAtAll) {
  double v = 0.0;
  EXPECT_TRUE(ParseDouble(" +1.5e-3 ", &v));
  EXPECT_EQ(v, 1.5e-3);
  for (const char* bad : {"", "1.5x", "1,5", "--1", "e5"})
    EXPECT_FALSE(ParseDouble(bad, &v)) << bad;
}

TEST(Error, IsOneLineOfPlaceMatterAndRemedy) {
  const Error error("is\nnegative", "scene.toml:3:mass", "give a positive one");
  EXPECT_STREQ(error.what(), "scene.toml:3:mass: is negative; give a positive one");
}

}  // namespace
}  // namespace unfurl::text_test
