// What fuzzing found, and the seeds it starts from: each is read or refused by every reader.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "tests/fuzz/readers.h"
#include "tests/repeats.h"
#include "tests/source_dir.h"

namespace unfurl::fuzz::corpus_test {
namespace {

namespace fs = std::filesystem;

std::string Get(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();
  return text.str();
}

// Of the shipped sets what is small enough to be fuzzed, and the corpus.
std::vector<fs::path> Seeds() {
  constexpr std::uintmax_t kLargest = 300000;  // bytes
  std::vector<fs::path> seeds;
  for (const char* folder : {"/data/sets", "/tests/fuzz/corpus", "/tests/fuzz/foreign"}) {
    for (const auto& entry :
         fs::recursive_directory_iterator(UNFURL_SOURCE_DIR + std::string(folder))) {
      if (entry.is_regular_file() && entry.file_size() < kLargest) seeds.push_back(entry.path());
    }
  }
  std::sort(seeds.begin(), seeds.end());
  return seeds;
}

TEST(Corpus, EveryReaderTakesOrRefusesEverySeed) {
  std::vector<int> taken(Readers().size(), 0);
  for (const fs::path& seed : Seeds()) {
    const std::string bytes = Get(seed);
    for (std::size_t r = 0; r < Readers().size(); ++r) {
      SCOPED_TRACE(seed.string() + " by " + Readers()[r].name);
      EXPECT_NO_THROW(taken[r] += Try(Readers()[r], bytes) ? 1 : 0);
    }
  }
  const auto taken_by = [&](const std::string& name) {
    for (std::size_t r = 0; r < Readers().size(); ++r) {
      if (Readers()[r].name == name) return taken[r];
    }
    return -1;
  };
  for (const char* name :
       {"toml",        "scene",        "lab",           "csv",         "points_csv",
        "tracks_csv",  "gsi",          "c3d",           "uff",         "raw_binary",
        "raw_csv",     "raw_png",      "expression",    "overrides",   "length",
        "journal",     "evaluation",   "info_h5",       "run_h5",      "run_rows_h5",
        "modes_h5",    "survey_h5",    "rig_h5",        "tracks_h5",   "fit_h5",
        "trial_h5",    "channels_csv", "channels_uff",  "channels_h5", "design",
        "wand",        "campaign",     "campaign_json", "campaign_h5", "trial_readings",
        "readings_h5", "raw_lines_h5",  "live_stream"}) {
    EXPECT_GT(taken_by(name), 0) << "no seed reaches the inside of reader " << name;
  }
}

bool IsHdf5(const std::string& bytes) { return bytes.starts_with("\x89HDF\r\n\x1a\n"); }

// Bytes changed, cut out, doubled and exchanged, without guidance: the long way is UNFURL_FUZZ.
// Readers of texts see texts, and readers of HDF5 files these: what is of the other kind they refuse
// at its first bytes, which the test above looks at.
TEST(Corpus, EveryReaderTakesOrRefusesWhatIsDamaged) {
  const int rounds = Repeats(1, 4);
  std::mt19937 random(5);
  const auto below = [&](std::size_t n) { return n == 0 ? 0 : random() % n; };
  for (const fs::path& seed : Seeds()) {
    const std::string whole = Get(seed);
    if (whole.empty() || whole.size() > 60000) continue;
    // HDF5 itself breaks on these (cli/flipped_bits_slow_test.cc).
    if (seed.string().find("/foreign/") != std::string::npos) continue;
    for (int round = 0; round < rounds; ++round) {
      std::string bytes = whole;
      for (std::size_t k = 1 + below(4); k > 0; --k) {
        const std::size_t at = below(bytes.size());
        switch (below(5)) {
          case 0:
            bytes[at] = static_cast<char>(random());
            break;
          case 1:
            bytes.erase(at, below(40));
            break;
          case 2:
            bytes.insert(at, bytes.substr(below(bytes.size()), below(40)));
            break;
          case 3:
            bytes[at] = "-9.e,;[]\"'={}\n"[below(14)];
            break;
          default:
            bytes.resize(at + 1);
        }
        if (bytes.empty()) bytes = "x";
      }
      for (const Reader& reader : Readers()) {
        if (reader.name.ends_with("_h5") != IsHdf5(whole)) continue;
        SCOPED_TRACE(seed.string() + " by " + reader.name);
        EXPECT_NO_THROW(Try(reader, bytes));
      }
    }
  }
}

}  // namespace
}  // namespace unfurl::fuzz::corpus_test
