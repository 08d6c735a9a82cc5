// Distances that marks keep, in words.
#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "base/count.h"
#include "base/error.h"
#include "base/length.h"
#include "base/text.h"
#include "measure/health.h"
#include "measure/kept_distances.h"

namespace unfurl::measure {

namespace {

std::string Words(const DistanceReport::Cause& cause, std::span<const std::string> cameras) {
  const std::string& first = cameras[static_cast<std::size_t>(cause.cameras[0])];
  if (cause.cameras.size() > 1) {
    return fmt::format("cameras {} and {} exchanged", first,
                       cameras[static_cast<std::size_t>(cause.cameras[1])]);
  }
  if (cause.lag != 0) {
    return fmt::format("camera {} {} by {}", first, cause.lag > 0 ? "late" : "early",
                       Counted(std::abs(cause.lag), "line"));
  }
  return fmt::format("camera {} moved by {:.2g} +- {:.1g} px", first, cause.px, cause.sigma_px);
}

// "320.017 +- 0.053 mm".
std::string LengthWithSigma(double length, double sigma) {
  const LengthUnit unit = UnitFor(length);
  return WithSigma(length * unit.per_metre, sigma * unit.per_metre) + " " + std::string(unit.name);
}

std::string Words(const DistanceReport::One& found, const KeptDistance& named) {
  if (found.samples == 0) {
    return fmt::format("{} and {} are nowhere found at one time", named.a, named.b);
  }
  std::string out = fmt::format("the distance of {} and {} comes out as {}", named.a, named.b,
                                LengthWithSigma(found.length, found.sigma));
  if (named.length > 0.0) {
    out += fmt::format(" ({} stated)", LengthWithSigma(named.length, named.sigma));
  }
  return out + fmt::format(" and varies by {}, where {} is expected", LengthText(found.scatter),
                           LengthText(found.expected));
}

}  // namespace

std::string Describe(const DistanceReport& report, std::span<const KeptDistance> distances,
                     std::span<const std::string> cameras) {
  if (distances.empty()) return {};
  if (!report.unknown.empty()) {
    return "whether marks keep their distances cannot be told: " + report.unknown;
  }
  std::vector<std::string> words;
  for (std::size_t k = 0; k < distances.size(); ++k) {
    words.push_back(Words(report.each[k], distances[k]));
  }
  std::string out = words[0];
  for (std::size_t k = 1; k < words.size(); ++k) out += "; " + words[k];
  std::vector<std::string> more;
  if (report.kept) {
    for (std::size_t c = 0; c < report.shows_px.size(); ++c) {
      more.push_back(std::isfinite(report.shows_px[c])
                         ? fmt::format("{} by {:.2g} px", cameras[c], report.shows_px[c])
                         : fmt::format("{} by any", cameras[c]));
    }
    return out +
           fmt::format(": kept. A camera that moved by more would have shown: {}", JoinWords(more));
  }
  out += ": not kept";
  if (report.causes.empty()) {
    return out + "; no shift, delay or exchange of cameras alone explains it";
  }
  for (const DistanceReport::Cause& cause : report.causes) more.push_back(Words(cause, cameras));
  out += "; what would explain it: " + more[0];
  for (std::size_t k = 1; k < more.size(); ++k) out += ", or " + more[k];
  return out;
}

void RequireMarks(std::span<const KeptDistance> distances, std::span<const std::string> marks,
                  const std::string& record) {
  for (const KeptDistance& one : distances) {
    for (const std::string& mark : {one.a, one.b}) {
      if (std::find(marks.begin(), marks.end(), mark) != marks.end()) continue;
      throw Error(fmt::format("names '{}', which is no mark of {}", mark, record), "--rigid",
                  fmt::format("its marks are {}", JoinWords(marks)));
    }
  }
}

KeptDistance ParseKeptDistance(const std::string& text, const std::string& where) {
  const auto refuse = [&](const std::string& what) {
    throw Error(fmt::format("'{}' {}", text, what), where,
                "name two marks on one rigid body, as tip,tip_b, and if it is known their "
                "distance, as tip,tip_b=0.32m+-0.1mm");
  };
  KeptDistance out;
  const std::size_t equals = text.find('=');
  const std::vector<std::string> names = Split(text.substr(0, equals), ',');
  if (names.size() != 2) refuse("names not two marks");
  out.a = Trim(names[0]);
  out.b = Trim(names[1]);
  if (out.a.empty() || out.b.empty() || out.a == out.b) refuse("names not two marks");
  if (equals == std::string::npos) return out;
  const std::string length = text.substr(equals + 1);
  const std::size_t sign = length.find("+-");
  if (sign == std::string::npos) refuse("does not say how well the distance is known");
  const bool read = ParseLength(Trim(length.substr(0, sign)), &out.length) &&
                    ParseLength(Trim(length.substr(sign + 2)), &out.sigma);
  if (!read || !(out.length > 0.0) || !(out.sigma > 0.0) || !(out.sigma < out.length)) {
    refuse("states no distance");
  }
  return out;
}

}  // namespace unfurl::measure
