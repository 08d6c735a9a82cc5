#include "correlate/compare/clock_words.h"

#include <fmt/format.h>

#include "base/number.h"

namespace unfurl::correlate {

std::vector<std::string> ClockWords(const Comparison& c, const std::string& found,
                                    const std::string& then) {
  const Alignment& a = c.alignment;
  const Prior& known = c.observations.placement.offset;
  std::vector<std::string> out;
  if (known.kind == Foreknowledge::kKnown) {
    out.push_back(
        fmt::format("The record's clock shows {} s when the reference's shows 0: that was known, "
                    "and not sought.",
                    a.at.offset));
  } else {
    out.push_back(fmt::format(
        "The record's clock shows {} s when the reference's shows 0: found from {}{}{}.",
        NumberWithError(a.at.offset, a.Sigma("time offset"), 6), found,
        known.kind == Foreknowledge::kNormal
            ? fmt::format(" and what was known, {} s", NumberWithError(known.mean, known.sigma, 6))
            : std::string(),
        then));
  }
  if (a.drift == 0.0) return out;
  const std::string by =
      a.Sigma("clock drift") > 0.0
          ? NumberWithError(1e6 * std::abs(a.drift), 1e6 * a.Sigma("clock drift"))
          : fmt::format("{:g} (known)", 1e6 * std::abs(a.drift));
  out.push_back(fmt::format(
      "The record's clock runs {} by {} parts in a million; that is taken out, about {:.3f} s.",
      a.drift > 0.0 ? "fast" : "slow", by, a.drift_pivot));
  return out;
}

}  // namespace unfurl::correlate
