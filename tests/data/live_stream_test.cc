// The stream of lines or readings: what was written comes out, in whatever pieces; all else is
// refused with the place.
#include "data/live_stream.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"
#include "base/random.h"

namespace unfurl::data::live_stream_test {
namespace {

using ::testing::HasSubstr;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

// Two cameras of unlike lines, with a flat field.
LiveHeader UnlikeCameras() {
  LiveHeader header;
  header.trial.cameras = {"left \"one\"", "right"};
  header.trial.slots = {"dark", "tip", "root+knee"};
  header.trial.line_rate = 730.0;
  for (const int active : {16, 21}) {
    LineFormat format;
    format.sensor = "S";
    format.dummy = 1;
    format.dark = 3;
    format.active = active;
    format.dark_after = 0;
    format.parity = 2;
    format.electrons_per_count = 1.5;
    format.read_noise_counts = 0.1;
    header.trial.format.by_camera.push_back(format);
  }
  static_cast<LineFormat&>(header.trial.format) = header.trial.format.by_camera[0];
  for (int k = 0; k < 37; ++k)
    header.trial.response.push_back(1.0F + 0.01F * static_cast<float>(k));
  return header;
}

TrialBlock SomeLines(const TrialHeader& header, std::size_t n, Rng* rng) {
  TrialBlock block;
  block.Resize(n, header);
  for (std::size_t i = 0; i < n; ++i) {
    block.t[i] = 0.1 + static_cast<double>(i) / 730.0;
    block.slot[i] = static_cast<std::int32_t>(i % header.slots.size());
  }
  for (auto& count : block.counts) count = static_cast<std::uint16_t>(rng->Uniform(0.0, 4095.9));
  return block;
}

std::string StreamOf(const LiveHeader& header, const TrialBlock& block) {
  std::string bytes;
  AppendLiveHeader(header, &bytes);
  for (std::size_t i = 0; i < block.size(); ++i) {
    AppendLiveLine(header.trial, block, i, block.t[i], i, &bytes);
  }
  AppendLiveEnd(false, block.size(), &bytes);
  return bytes;
}

TEST(LiveStream, LinesComeOutAsTheyWentInWhateverThePieces) {
  Rng rng(5);
  const LiveHeader header = UnlikeCameras();
  const TrialBlock sent = SomeLines(header.trial, 40, &rng);
  const std::string bytes = StreamOf(header, sent);
  for (const double piece : {1.0, 3.0, 40.0, 1000.0, 1e6}) {
    LiveStreamReader reader("the pipe");
    TrialBlock all, block;
    for (std::size_t at = 0; at < bytes.size();) {
      const auto n = static_cast<std::size_t>(std::ceil(rng.Uniform(0.0, piece)));
      reader.Feed(std::string_view(bytes).substr(at, n));
      at += n;
      while (reader.header() != nullptr && reader.Take(7, &block) > 0) {
        all.t.insert(all.t.end(), block.t.begin(), block.t.end());
        all.slot.insert(all.slot.end(), block.slot.begin(), block.slot.end());
        all.counts.insert(all.counts.end(), block.counts.begin(), block.counts.end());
      }
    }
    EXPECT_TRUE(reader.ended());
    EXPECT_NO_THROW(reader.Close());
    EXPECT_EQ(reader.taken(), 40U);
    EXPECT_EQ(all.t, sent.t);
    EXPECT_EQ(all.slot, sent.slot);
    EXPECT_EQ(all.counts, sent.counts);
    ASSERT_NE(reader.header(), nullptr);
    const TrialHeader& got = reader.header()->trial;
    EXPECT_EQ(got.cameras, header.trial.cameras);
    EXPECT_EQ(got.slots, header.trial.slots);
    EXPECT_EQ(got.line_rate, 730.0);
    EXPECT_EQ(got.response, header.trial.response);
    EXPECT_EQ(got.format.Of(1).active, 21);
    EXPECT_EQ(got.format.Of(0).electrons_per_count, 1.5);
  }
}

TEST(LiveStream, ReadingsComeOutAsTheyWentIn) {
  LiveHeader header;
  header.readings = true;
  header.trial.cameras = {"a", "b"};
  header.trial.slots = {"tip", "x+y"};
  header.pixels = {1000, 2000};
  TrialReadings sent;
  sent.cameras = header.trial.cameras;
  sent.slots = header.trial.slots;
  sent.most = 2;
  sent.t = {0.25, 0.25, 1.0 / 3.0};
  sent.slot = {0, 1, 0};
  sent.u_px = {1.0 / 7.0, kNone, kNone, kNone, 5.0, 6.5, 7.0, kNone, 999.25, kNone, 0.0, kNone};
  sent.s_px.assign(12, 0.05);
  std::string bytes;
  AppendLiveHeader(header, &bytes);
  for (std::size_t i = 0; i < 3; ++i) AppendLiveFlash(sent, i, sent.t[i], i, &bytes);
  AppendLiveEnd(true, 3, &bytes);
  LiveStreamReader reader("the pipe");
  reader.Feed(bytes);
  TrialReadings got;
  ASSERT_EQ(reader.Take(10, &got), 3U);
  EXPECT_TRUE(reader.ended());
  EXPECT_EQ(got.t, sent.t);
  EXPECT_EQ(got.slot, sent.slot);
  EXPECT_EQ(reader.header()->pixels, header.pixels);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t c = 0; c < 2; ++c) {
      for (std::size_t k = 0; k < 2; ++k) {
        const double in = sent.Readings(i, c)[k], out = got.Readings(i, c)[k];
        EXPECT_TRUE(in == out || (std::isnan(in) && std::isnan(out)));
      }
      EXPECT_TRUE(std::isnan(got.Readings(i, c)[2]));
    }
  }
}

// What a stream's bytes come to, in one piece.
std::string WordsOf(const std::string& bytes) {
  try {
    LiveStreamReader reader("pipe");
    reader.Feed(bytes);
    TrialBlock lines;
    TrialReadings flashes;
    while (reader.header() != nullptr &&
           (reader.header()->readings ? reader.Take(5, &flashes) : reader.Take(5, &lines)) > 0) {
    }
    reader.Close();
  } catch (const Error& error) {
    return error.what();
  }
  return "good";
}

TEST(LiveStream, WhatIsNoneIsRefusedWithItsPlace) {
  Rng rng(6);
  const LiveHeader header = UnlikeCameras();
  const TrialBlock block = SomeLines(header.trial, 4, &rng);
  const std::string whole = StreamOf(header, block);
  std::string head;
  AppendLiveHeader(header, &head);
  const std::size_t line = 24 + 2 * header.trial.line_counts();
  const auto with = [&](std::size_t at, const std::string& bytes) {
    std::string changed = whole;
    changed.replace(at, bytes.size(), bytes);
    return changed;
  };
  ASSERT_EQ(WordsOf(whole), "good");
  EXPECT_THAT(WordsOf(""), HasSubstr("ends before it begins"));
  EXPECT_THAT(WordsOf("{"), HasSubstr("ends within its header"));
  EXPECT_THAT(WordsOf("hello\n"), HasSubstr("does not begin as a stream"));
  EXPECT_THAT(WordsOf(std::string(17 << 20, 'x')), HasSubstr("without the end of a line"));
  EXPECT_THAT(WordsOf(whole.substr(0, head.size() + 2 * line)),
              HasSubstr("ends without saying so"));
  EXPECT_THAT(WordsOf(whole.substr(0, head.size() + 2 * line + 30)), HasSubstr("is cut short"));
  EXPECT_THAT(WordsOf(whole + "more"), HasSubstr("goes on after its end"));
  EXPECT_THAT(WordsOf(with(head.size() + line, "LIME")), HasSubstr("pipe: line 1: does not begin"));
  EXPECT_THAT(WordsOf(with(head.size() + line + 4, "\x07")), HasSubstr("shows slot 7"));
  EXPECT_THAT(WordsOf(with(head.size() + line + 8, "\x03")), HasSubstr("lines were lost"));
  EXPECT_THAT(WordsOf(with(head.size() + line + 8, std::string(1, '\0'))), HasSubstr("came twice"));
  EXPECT_THAT(WordsOf(with(head.size() + 16, std::string(6, '\0') + "\xf8\x7f")),
              HasSubstr("its time is no number"));
  EXPECT_THAT(WordsOf(with(head.size() + line + 16, std::string(8, '\0'))),
              HasSubstr("is before that of the last one"));
  EXPECT_THAT(WordsOf(with(head.size() + 24, "\xff\xff")), HasSubstr("beyond its 12 bits"));
  EXPECT_THAT(WordsOf(with(whole.size() - 16, "\x09")), HasSubstr("the end speaks of 9 lines"));
}

TEST(LiveStream, HeadersThatCannotBeAreRefusedByTheKey) {
  std::string good;
  AppendLiveHeader(UnlikeCameras(), &good);
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = good;
    const std::size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return WordsOf(changed.replace(at, from.size(), to));
  };
  EXPECT_THAT(with("\"version\":1", "\"version\":2"), HasSubstr("is version 2"));
  EXPECT_THAT(with("\"lines\"", "\"films\""), HasSubstr("neither lines nor readings"));
  EXPECT_THAT(with("\"active\":16", "\"active\":2000000000"), HasSubstr("pipe:format.active"));
  EXPECT_THAT(with("\"active\":16", "\"active\":1e300"), HasSubstr("pipe:format.active"));
  EXPECT_THAT(with("\"dummy\":1", "\"dummy\":-1"), HasSubstr("pipe:format.dummy"));
  EXPECT_THAT(with("\"bits\":12", "\"bits\":17"), HasSubstr("pipe:format.bits"));
  EXPECT_THAT(with("\"line_rate\":730.0", "\"line_rate\":0"), HasSubstr("pipe:line_rate"));
  EXPECT_THAT(with("\"right\"", "\"left \\\"one\\\"\""), HasSubstr("has a name twice"));
  EXPECT_THAT(with("\"slots\"", "\"plots\":1,\"slots\""), HasSubstr("is no key of a header"));
  EXPECT_THAT(with("1.0099", "900099"), HasSubstr("beyond what a pixel can be"));
  const std::string readings = R"({"unfurl":"readings","version":1,"cameras":["a"],"slots":["t"]})";
  const auto flash = [&](const std::string& text) {
    return WordsOf(readings + "\n" + text + "\n");
  };
  EXPECT_THAT(flash(R"({"n":0,"t":0,"slot":"t","u":[[1]],"s":[[0]]})"),
              HasSubstr("sigma that is none"));
  EXPECT_THAT(flash(R"({"n":0,"t":0,"slot":"q","u":[[1]],"s":[[1]]})"),
              HasSubstr("not in the header"));
  EXPECT_THAT(flash(R"({"n":0,"t":0,"slot":"t","u":[[1],[2]],"s":[[1]]})"),
              HasSubstr("not 1 lists"));
  EXPECT_THAT(
      flash(R"({"n":0,"t":0,"slot":"t","u":[[1,2,3,4,5,6,7,8,9]],"s":[[1,2,3,4,5,6,7,8,9]]})"),
      HasSubstr("at most 8"));
  EXPECT_THAT(flash(R"({"n":0,"t":0,"slot":"t","u":[[1]]})"), HasSubstr("has no \"s\""));
  EXPECT_THAT(flash(R"({"end":-3})"), HasSubstr("its end is no number"));
  EXPECT_THAT(flash("[[[["), HasSubstr("is no JSON object"));
}

}  // namespace
}  // namespace unfurl::data::live_stream_test
