#include "data/journal.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "base/error.h"
#include "tests/own_folder.h"

namespace unfurl::data::journal_test {
namespace {

namespace fs = std::filesystem;

class JournalFile : public ::testing::Test {
 protected:
  std::string Bytes() const {
    std::ifstream stream(partial_, std::ios::binary);
    std::ostringstream text;
    text << stream.rdbuf();
    return text.str();
  }
  void Put(const std::string& bytes) const {
    std::ofstream(partial_, std::ios::binary | std::ios::trunc) << bytes;
  }
  OwnFolder folder_;
  std::string result_ = folder_.File("fit.h5"), partial_ = result_ + ".partial";
};

const std::vector<std::string> kRecords = {"one", std::string("t\0wo", 4), "", "three"};

TEST_F(JournalFile, ComesBackAfterAKill) {
  {
    Journal journal(result_, "id", false);
    for (const std::string& record : kRecords) journal.Append(record);
    EXPECT_EQ(journal.Read(1), kRecords[1]);
  }
  Journal journal(result_, "id", true);
  ASSERT_EQ(journal.found(), kRecords.size());
  for (std::size_t i = 0; i < kRecords.size(); ++i) EXPECT_EQ(journal.Read(i), kRecords[i]);
  journal.Append("four");
  EXPECT_EQ(journal.Read(4), "four");
  journal.Remove();
  EXPECT_FALSE(fs::exists(partial_));
}

// Wherever the file was cut, all records that were whole by then are there, and new ones can be
// added behind them.
TEST_F(JournalFile, ACutAtAnyByteLosesOneRecordAtMost) {
  std::vector<std::size_t> ends;
  {
    Journal journal(result_, "id", false);
    ends.push_back(Bytes().size());
    for (const std::string& record : kRecords) {
      journal.Append(record);
      ends.push_back(Bytes().size());
    }
  }
  const std::string whole = Bytes();
  for (std::size_t cut = 0; cut <= whole.size(); ++cut) {
    Put(whole.substr(0, cut));
    std::size_t expected = 0;
    while (expected + 1 < ends.size() && ends[expected + 1] <= cut) ++expected;
    {
      Journal journal(result_, "id", true);
      ASSERT_EQ(journal.found(), expected) << "cut at " << cut;
      journal.Append("after");
    }
    Journal again(result_, "id", true);
    ASSERT_EQ(again.found(), expected + 1);
    EXPECT_EQ(again.Read(expected), "after");
  }
}

TEST_F(JournalFile, AFlippedBitEndsIt) {
  {
    Journal journal(result_, "id", false);
    for (const std::string& record : kRecords) journal.Append(record);
  }
  std::string bytes = Bytes();
  bytes[bytes.size() - 2] = static_cast<char>(bytes[bytes.size() - 2] ^ 1);
  Put(bytes);
  EXPECT_EQ(Journal(result_, "id", true).found(), kRecords.size() - 1);
}

TEST_F(JournalFile, OfOtherInputsIsRefused) {
  { Journal(result_, "id", false).Append("one"); }
  EXPECT_THROW(Journal(result_, "other", true), Error);
  EXPECT_EQ(Journal(result_, "id", true).found(), 1u);  // and is still whole
}

TEST_F(JournalFile, WithoutResumeIsSetAside) {
  { Journal(result_, "id", false).Append("one"); }
  { Journal(result_, "id", false).Append("two"); }
  EXPECT_TRUE(fs::exists(partial_ + "~"));
  Journal journal(result_, "id", true);
  ASSERT_EQ(journal.found(), 1u);
  EXPECT_EQ(journal.Read(0), "two");
}

TEST_F(JournalFile, ASecondWriterIsRefusedAndNothingIsLeftOfNothing) {
  {
    Journal first(result_, "id", false);
    EXPECT_THROW(Journal(result_, "id", false), Error);
  }
  EXPECT_FALSE(fs::exists(partial_));
}

}  // namespace
}  // namespace unfurl::data::journal_test
