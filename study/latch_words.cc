#include "study/latch_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace unfurl::study {

std::vector<std::string> LatchWords(const std::vector<correlate::ModelEvent>& a,
                                    const std::vector<correlate::ModelEvent>& b, double tell) {
  std::vector<std::string> out;
  auto latches = [](const std::vector<correlate::ModelEvent>& events) {
    std::vector<correlate::ModelEvent> all;
    for (const correlate::ModelEvent& e : events) {
      if (e.kind == "latch") all.push_back(e);
    }
    return all;
  };
  std::vector<correlate::ModelEvent> left = latches(b);
  for (const correlate::ModelEvent& e : latches(a)) {
    const auto same = std::find_if(left.begin(), left.end(), [&](const correlate::ModelEvent& x) {
      return x.where == e.where;
    });
    if (same == left.end()) {
      out.push_back(e.where + " does not latch");
      continue;
    }
    const double later = same->t - e.t;
    if (std::abs(later) > tell) {
      out.push_back(fmt::format("{} {:+.3g} ms", e.where, 1e3 * later));
    }
    left.erase(same);
  }
  for (const correlate::ModelEvent& e : left) out.push_back(e.where + " latches");
  return out;
}

}  // namespace unfurl::study
