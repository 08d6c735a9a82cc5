// The first line of a stream, JSON.
#include "data/live_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/text.h"
#include "data/line_format_io.h"

namespace unfurl::data {

namespace {

using nlohmann::json;
using nlohmann::ordered_json;

constexpr int kLiveHeaderVersion = 1;
constexpr char kHint[] = "see docs/live.md for the header";

class HeaderReader {
 public:
  HeaderReader(const json& header, const std::string& where) : header_(header), where_(where) {}

  LiveHeader Read() {
    LiveHeader out;
    if (!header_.at("unfurl").is_string()) Fail("unfurl", "is no word");
    const std::string kind = header_.at("unfurl").get<std::string>();
    if (kind != "lines" && kind != "readings") {
      Fail("unfurl", fmt::format("is '{}', neither lines nor readings", kind));
    }
    out.readings = kind == "readings";
    const json& version = Need("version");
    if (version != kLiveHeaderVersion) {
      throw Error(fmt::format("is version {} of the stream; this program reads version {}",
                              version.dump(-1, ' ', false, json::error_handler_t::replace),
                              kLiveHeaderVersion),
                  where_ + ":version", "send version 1, or take the program that it is for");
    }
    out.trial.cameras = Names("cameras");
    out.trial.slots = Names("slots");
    if (out.readings) {
      OnlyThese({"unfurl", "version", "cameras", "slots", "pixels"});
      if (header_.contains("pixels")) out.pixels = Pixels(out.trial.cameras.size());
      return out;
    }
    OnlyThese({"unfurl", "version", "cameras", "slots", "line_rate", "format", "response"});
    out.trial.line_rate = Real(Need("line_rate"), "line_rate", false);
    Formats(&out.trial);
    if (header_.contains("response")) Response(&out.trial);
    return out;
  }

 private:
  [[noreturn]] void Fail(const std::string& key, const std::string& problem) const {
    throw Error(problem, where_ + ":" + key, kHint);
  }
  const json& Need(const char* key) const {
    const auto at = header_.find(key);
    if (at == header_.end()) Fail(key, "is missing");
    return *at;
  }
  void OnlyThese(const std::vector<std::string>& keys) const {
    for (const auto& [key, value] : header_.items()) {
      if (std::find(keys.begin(), keys.end(), key) == keys.end())
        Fail(key, "is no key of a header");
    }
  }
  std::vector<std::string> Names(const char* key) const {
    const json& list = Need(key);
    std::vector<std::string> names;
    if (!list.is_array() || list.empty()) Fail(key, "is no list of names");
    for (const json& name : list) {
      if (!name.is_string() || name.get<std::string>().empty())
        Fail(key, "has a name that is none");
      names.push_back(name.get<std::string>());
    }
    std::vector<std::string> sorted = names;
    std::sort(sorted.begin(), sorted.end());
    if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end()) {
      Fail(key, "has a name twice");
    }
    return names;
  }
  double Real(const json& value, const std::string& key, bool zero) const {
    constexpr double kLargest = 1e12;  // beyond, a number is a mistake
    const double x = value.is_number() ? value.get<double>() : std::nan("");
    if (!(zero ? x >= 0.0 : x > 0.0) || x > kLargest) Fail(key, "is no number that can be");
    return x;
  }
  int Whole(const json& value, const std::string& key, int low, int high) const {
    const bool whole = value.is_number_integer();
    if (!whole || value.get<double>() < low || value.get<double>() > high) {
      Fail(key, fmt::format("is no whole number from {} to {}", low, high));
    }
    return value.get<int>();
  }
  std::vector<int> Pixels(std::size_t cameras) const {
    const json& list = header_.at("pixels");
    if (!list.is_array() || list.size() != cameras) Fail("pixels", "is no number for each camera");
    std::vector<int> pixels;
    for (const json& value : list) {
      pixels.push_back(Whole(value, "pixels", 1, std::numeric_limits<int>::max()));
    }
    return pixels;
  }
  LineFormat Format(const json& of) const {
    LineFormat format;
    if (!of.is_object()) Fail("format", "is no object");
    std::size_t known = 0;
    const auto value = [&](const char* name) -> const json& {
      const auto at = of.find(name);
      if (at == of.end()) Fail(fmt::format("format.{}", name), "is missing");
      ++known;
      return *at;
    };
    if (!value("sensor").is_string()) Fail("format.sensor", "is no name");
    format.sensor = of.at("sensor").get<std::string>();
    for (const LineFormatWhole& whole : kLineFormatWhole) {
      format.*whole.member =
          Whole(value(whole.name), fmt::format("format.{}", whole.name), whole.low, whole.high);
    }
    for (const LineFormatReal& real : kLineFormatReal) {
      format.*real.member = Real(value(real.name), fmt::format("format.{}", real.name), real.zero);
    }
    if (known != of.size()) Fail("format", "has a key that is no part of a format");
    return format;
  }
  void Formats(TrialHeader* trial) const {
    const json& formats = Need("format");
    if (formats.is_object()) {
      static_cast<LineFormat&>(trial->format) = Format(formats);
      return;
    }
    if (!formats.is_array() || formats.size() != trial->cameras.size()) {
      Fail("format", "is neither one object nor one for each camera");
    }
    for (const json& one : formats) trial->format.by_camera.push_back(Format(one));
    static_cast<LineFormat&>(trial->format) = trial->format.by_camera[0];
  }
  void Response(TrialHeader* trial) const {
    const json& lists = header_.at("response");
    if (!lists.is_array() || lists.size() != trial->cameras.size()) {
      Fail("response", "is no list for each camera");
    }
    for (std::size_t c = 0; c < lists.size(); ++c) {
      if (!lists[c].is_array() ||
          lists[c].size() != static_cast<std::size_t>(trial->format.Of(c).active)) {
        Fail("response",
             fmt::format("of camera '{}' is no number for each active pixel", trial->cameras[c]));
      }
      for (const json& value : lists[c]) {
        const double r = value.is_number() ? value.get<double>() : 0.0;
        if (!(r >= kLowestResponse && r <= kHighestResponse)) {
          Fail("response",
               fmt::format("of camera '{}' is beyond what a pixel can be", trial->cameras[c]));
        }
        trial->response.push_back(static_cast<float>(r));
      }
    }
  }

  const json& header_;
  const std::string& where_;
};

ordered_json ToJson(const LineFormat& format) {
  ordered_json out = {{"sensor", format.sensor}};
  for (const LineFormatWhole& whole : kLineFormatWhole) out[whole.name] = format.*whole.member;
  for (const LineFormatReal& real : kLineFormatReal) out[real.name] = format.*real.member;
  return out;
}

}  // namespace

LiveHeader ParseLiveHeader(const json& header, const std::string& where) {
  return HeaderReader(header, where).Read();
}

std::string LiveHeaderText(const LiveHeader& header) {
  const TrialHeader& trial = header.trial;
  ordered_json out = {{"unfurl", header.readings ? "readings" : "lines"},
                      {"version", kLiveHeaderVersion},
                      {"cameras", trial.cameras},
                      {"slots", trial.slots}};
  if (header.readings) {
    if (!header.pixels.empty()) out["pixels"] = header.pixels;
  } else {
    out["line_rate"] = trial.line_rate;
    out["format"] = ToJson(trial.format);
    if (!trial.format.by_camera.empty()) {
      out["format"] = ordered_json::array();
      for (const LineFormat& format : trial.format.by_camera)
        out["format"].push_back(ToJson(format));
    }
    for (std::size_t c = 0; c < trial.cameras.size() && !trial.response.empty(); ++c) {
      const auto from =
          trial.response.begin() + static_cast<std::ptrdiff_t>(trial.format.ActiveBefore(c));
      out["response"].push_back(std::vector<float>(from, from + trial.format.Of(c).active));
    }
  }
  return out.dump(-1, ' ', false, ordered_json::error_handler_t::replace);
}

}  // namespace unfurl::data
