#include "data/live_stream.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "data/live_header.h"

namespace unfurl::data {

namespace {

using nlohmann::json;

static_assert(std::endian::native == std::endian::little, "counts are copied as they stand");

constexpr char kVersionKey[] = "unfurl";
// Flat fields of 32 cameras of 8000 pixels in text take 6 MB.
constexpr std::size_t kLongestHeader = 16U << 20U;  // [byte]
// 8 readings of 32 cameras with their sigmas take 26 kB.
constexpr std::size_t kLongestFlash = 1U << 20U;  // [byte]
constexpr double kLiveStreamNone = std::numeric_limits<double>::quiet_NaN();

// Before the counts of a line, little endian.
struct LiveStreamHead {
  char word[4];  // LINE, or END.
  std::uint32_t slot;
  std::uint64_t number;
  double t;  // [s]
};
static_assert(sizeof(LiveStreamHead) == 24);

// Of a flash, by camera; what is wrong with them, or nothing.
std::string AddReadings(const TrialHeader& trial, const json& u, const json& s,
                        TrialReadings* block) {
  const std::size_t cameras = trial.cameras.size(), from = block->u_px.size();
  if (!u.is_array() || !s.is_array() || u.size() != cameras || s.size() != cameras) {
    return fmt::format("u and s are not {} lists", cameras);
  }
  block->u_px.resize(from + cameras * block->most, kLiveStreamNone);
  block->s_px.resize(block->u_px.size(), kLiveStreamNone);
  for (std::size_t c = 0; c < cameras; ++c) {
    if (!u[c].is_array() || !s[c].is_array() || u[c].size() != s[c].size() ||
        u[c].size() > block->most) {
      return fmt::format("camera '{}' has no two lists of equal length, at most {}",
                         trial.cameras[c], block->most);
    }
    for (std::size_t k = 0; k < u[c].size(); ++k) {
      if (!u[c][k].is_number() || !s[c][k].is_number() || !(s[c][k].get<double>() > 0.0)) {
        return fmt::format("camera '{}' has a reading or sigma that is none", trial.cameras[c]);
      }
      block->u_px[from + c * block->most + k] = u[c][k].get<double>();
      block->s_px[from + c * block->most + k] = s[c][k].get<double>();
    }
  }
  return {};
}

}  // namespace

void LiveStreamReader::Fail(const std::string& problem, const std::string& remedy) const {
  throw Error(problem, header_ ? fmt::format("{}: line {}", where_, number_) : where_, remedy);
}

void LiveStreamReader::Feed(std::string_view bytes) {
  if (ended_ && !bytes.empty()) Fail("goes on after its end", "start a stream for each trial");
  if (at_ > 0) {
    buffer_.erase(0, at_);
    at_ = 0;
  }
  buffer_.append(bytes);
  if (header_) return;
  if (const auto text = NextText(kLongestHeader)) ReadHeader(*text);
}

std::optional<std::string_view> LiveStreamReader::NextText(std::size_t most) {
  const std::string_view rest = Rest();
  const std::size_t end = rest.find('\n', searched_);
  if (end == std::string_view::npos ? rest.size() > most : end > most) {
    Fail(fmt::format("has more than {} bytes without the end of a line", most),
         "write the stream as docs/live.md has it");
  }
  searched_ = end == std::string_view::npos ? rest.size() : 0;
  if (end == std::string_view::npos) return std::nullopt;
  at_ += end + 1;
  return rest.substr(0, end);
}

void LiveStreamReader::ReadHeader(std::string_view text) {
  const json header = json::parse(text, nullptr, false);
  if (!header.is_object() || !header.contains(kVersionKey)) {
    Fail("does not begin as a stream of lines or readings", "see docs/live.md for its header");
  }
  header_ = ParseLiveHeader(header, where_);
}

void LiveStreamReader::CheckTime(double t) {
  if (!std::isfinite(t)) Fail("its time is no number", "give seconds on the recorder's clock");
  if (t < last_t_) {
    Fail(fmt::format("its time {} s is before that of the last one, {} s", t, last_t_),
         "send lines in order of time");
  }
  last_t_ = t;
}

void LiveStreamReader::CheckNumber(std::uint64_t number) const {
  if (number == number_) return;
  Fail(fmt::format("is numbered {}: {}", number,
                   number > number_ ? "lines were lost on the way" : "lines came twice"),
       "number them from 0, send each once, and do not drop any");
}

void LiveStreamReader::CheckEnd(std::uint64_t lines) {
  if (lines != number_) {
    Fail(fmt::format("the end speaks of {} lines, {} have come", lines, number_),
         "send every line, and how many they were");
  }
  ended_ = true;
  if (!Rest().empty()) Fail("goes on after its end", "start a stream for each trial");
}

bool LiveStreamReader::NextLine(std::size_t counts) {
  const std::string_view rest = Rest();
  if (rest.size() < sizeof(LiveStreamHead)) return false;
  LiveStreamHead head;
  std::memcpy(&head, rest.data(), sizeof head);
  const std::string_view word(head.word, sizeof head.word);
  if (word == "END.") {
    at_ += sizeof head;
    CheckEnd(head.number);
    return false;
  }
  if (word != "LINE") {
    Fail("does not begin with LINE",
         "check that every line has the counts that the header promises");
  }
  return rest.size() >= sizeof head + counts * sizeof(std::uint16_t);
}

std::size_t LiveStreamReader::Take(std::size_t most, TrialBlock* block) {
  const TrialHeader& trial = header_->trial;
  const std::size_t counts = trial.line_counts();
  const std::size_t size = sizeof(LiveStreamHead) + counts * sizeof(std::uint16_t);
  // No room is made for lines that are not there.
  const std::size_t whole = std::min(most, Rest().size() / size);
  block->Resize(whole, trial);
  std::size_t n = 0;
  while (n < whole && !ended_ && NextLine(counts)) {
    const std::string_view rest = Rest();
    LiveStreamHead head;
    std::memcpy(&head, rest.data(), sizeof head);
    CheckNumber(head.number);
    CheckTime(head.t);
    if (head.slot >= trial.slots.size()) {
      Fail(fmt::format("shows slot {}, but the header names {}", head.slot, trial.slots.size()),
           "give the slot's place in the header's list, from 0");
    }
    block->t[n] = head.t;
    block->slot[n] = static_cast<std::int32_t>(head.slot);
    std::uint16_t* line = &block->counts[n * counts];
    std::memcpy(line, rest.data() + sizeof head, counts * sizeof(std::uint16_t));
    for (std::size_t c = 0; c < trial.cameras.size(); ++c) {
      const auto full = static_cast<std::uint16_t>(trial.format.Of(c).full_scale());
      const std::uint16_t* from = line + trial.format.ElementsBefore(c);
      const std::uint16_t* to = line + trial.format.ElementsBefore(c + 1);
      const std::uint16_t highest = *std::max_element(from, to);
      if (highest <= full) continue;
      Fail(fmt::format("camera '{}' counts {}, beyond its {} bits", trial.cameras[c], highest,
                       trial.format.Of(c).bits),
           "check the bits of its format and the order of the bytes (little endian)");
    }
    at_ += size;
    ++n;
    ++number_;
  }
  // The end may stand alone behind the last line.
  if (n == whole && n < most && !ended_) NextLine(counts);
  block->Resize(n, trial);
  return n;
}

bool LiveStreamReader::ReadFlash(std::string_view text, TrialReadings* block) {
  const json flash = json::parse(text, nullptr, false);
  if (!flash.is_object()) Fail("is no JSON object", "write a flash in each line of text");
  if (flash.contains("end")) {
    if (!flash["end"].is_number_unsigned() || flash.size() != 1) {
      Fail("its end is no number", "end the stream with {\"end\": NUMBER OF FLASHES}");
    }
    CheckEnd(flash["end"].get<std::uint64_t>());
    return false;
  }
  const TrialHeader& trial = header_->trial;
  const auto member = [&](const char* name) -> const json& {
    const auto at = flash.find(name);
    if (at == flash.end()) Fail(fmt::format("has no \"{}\"", name), "give n, t, slot, u and s");
    return *at;
  };
  const json &n = member("n"), &t = member("t"), &slot = member("slot"), &u = member("u"),
             &s = member("s");
  if (flash.size() != 5) Fail("has an unknown key", "give n, t, slot, u and s");
  if (!n.is_number_unsigned() || !t.is_number() || !slot.is_string()) {
    Fail("n, t and slot are no number, time and name", "see docs/live.md");
  }
  CheckNumber(n.get<std::uint64_t>());
  CheckTime(t.get<double>());
  const auto named = std::find(trial.slots.begin(), trial.slots.end(), slot.get<std::string>());
  if (named == trial.slots.end()) {
    Fail(fmt::format("the slot '{}' is not in the header", slot.get<std::string>()),
         "name every slot there");
  }
  if (const std::string problem = AddReadings(trial, u, s, block); !problem.empty()) {
    Fail(problem, "give for each camera its readings in u, their sigmas in s [px]");
  }
  block->t.push_back(t.get<double>());
  block->slot.push_back(static_cast<std::int32_t>(named - trial.slots.begin()));
  return true;
}

std::size_t LiveStreamReader::Take(std::size_t most, TrialReadings* block) {
  block->path = where_;
  block->cameras = header_->trial.cameras;
  block->pixels = header_->pixels;
  block->slots = header_->trial.slots;
  block->most = kMostReadings;
  block->t.clear();
  block->slot.clear();
  block->u_px.clear();
  block->s_px.clear();
  while (block->size() < most && !ended_) {
    const auto text = NextText(kLongestFlash);
    if (!text || !ReadFlash(*text, block)) break;
    ++number_;
  }
  return block->size();
}

void LiveStreamReader::Close() const {
  if (ended_) return;
  if (!header_) {
    Fail(buffer_.empty() ? "ends before it begins" : "ends within its header",
         "send a header and lines, as unfurl stream does");
  }
  Fail(Rest().empty() ? "ends without saying so" : "is cut short",
       "lines may be missing: see what became of the recorder");
}

void AppendLiveHeader(const LiveHeader& header, std::string* out) {
  *out += LiveHeaderText(header) + "\n";
}

void AppendLiveLine(const TrialHeader& header, const TrialBlock& block, std::size_t i, double t,
                    std::uint64_t number, std::string* out) {
  LiveStreamHead head{{'L', 'I', 'N', 'E'}, static_cast<std::uint32_t>(block.slot[i]), number, t};
  const std::size_t counts = header.line_counts();
  out->append(reinterpret_cast<const char*>(&head), sizeof head);
  out->append(reinterpret_cast<const char*>(&block.counts[i * counts]),
              counts * sizeof(std::uint16_t));
}

void AppendLiveFlash(const TrialReadings& readings, std::size_t i, double t, std::uint64_t number,
                     std::string* out) {
  json u = json::array(), s = json::array();
  for (std::size_t c = 0; c < readings.cameras.size(); ++c) {
    json of_u = json::array(), of_s = json::array();
    for (std::size_t k = 0; k < readings.most && !std::isnan(readings.Readings(i, c)[k]); ++k) {
      of_u.push_back(readings.Readings(i, c)[k]);
      of_s.push_back(readings.Sigmas(i, c)[k]);
    }
    u.push_back(of_u);
    s.push_back(of_s);
  }
  const json flash = {{"n", number},
                      {"t", t},
                      {"slot", readings.slots[static_cast<std::size_t>(readings.slot[i])]},
                      {"u", u},
                      {"s", s}};
  *out += flash.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
}

void AppendLiveEnd(bool readings, std::uint64_t lines, std::string* out) {
  if (readings) {
    *out += fmt::format("{{\"end\":{}}}\n", lines);
    return;
  }
  const LiveStreamHead head{{'E', 'N', 'D', '.'}, 0, lines, 0.0};
  out->append(reinterpret_cast<const char*>(&head), sizeof head);
}

}  // namespace unfurl::data
